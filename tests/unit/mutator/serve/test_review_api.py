"""The requests of the review page's script."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mutator.review.mutant_groups import groups_of_library
from mutator.review.review_state_and_actions import (
    ReviewAction,
    ReviewActionKind,
    load_review,
    record_actions,
)
from mutator.workspace import Workspace

from .conftest import SECRET, Client
from .test_files import HOSTILE

API = "/api/review/toycar"


@pytest.fixture
def reviewed(
    toycar: Workspace, tmp_path: Path, served_at: Callable[[Workspace, Path], Any]
) -> Iterator[tuple[Client, list[str]]]:
    (tmp_path / "runs").mkdir()
    with served_at(toycar, tmp_path / "runs") as client:
        yield client, list(client.get(f"{API}?spec=sensor/*").json["groups"])


def decided(client: Client, *changes: tuple[str, str], by: str = "Jane", **more: Any) -> Any:
    groups = client.get(f"{API}?spec=sensor/*").json["groups"]
    body = {
        "changes": [{"group": group, "kind": kind, "text": more.get("text", "")} for group, kind in changes],
        "by": by,
        "seen": {group: groups[group]["revision"] for group, _ in changes if group in groups},
        "digests": {group: groups[group]["digest"] for group, _ in changes if group in groups},
    }
    return client.post(f"{API}?spec=sensor/*", body | {k: v for k, v in more.items() if k != "text"})


def test_a_decision_is_in_the_file_and_on_the_reloaded_page(
    reviewed: tuple[Client, list[str]], toycar: Workspace
) -> None:
    client, (first, second, *_) = reviewed
    answer = decided(client, (first, "approve"), (second, "flag"))
    assert answer.status == 200
    assert answer.json["groups"][first]["state"] == "approved"
    assert decided(client, (first, "remark"), text="limits?").status == 200
    groups = client.get(f"{API}?spec=sensor/*").json["groups"]
    assert groups[first]["decision"]["by"] == "Jane"
    assert [remark["text"] for remark in groups[first]["remarks"]] == ["limits?"]
    assert groups[second]["flag"]["by"] == "Jane" and groups[second]["state"] == "new"
    review = load_review(toycar, "toycar")
    assert review.decision(first) and review.flag(second)
    assert client.get("/review/toycar?spec=sensor/*").status == 200


def test_the_text_of_a_rejection_is_its_reason(reviewed: tuple[Client, list[str]], toycar: Workspace) -> None:
    client, (first, *_) = reviewed
    answer = decided(client, (first, "reject"), text="too large")
    assert answer.json["groups"][first]["decision"]["reason"] == "too large"
    assert not answer.json["groups"][first]["remarks"]
    decision = load_review(toycar, "toycar").decision(first)
    assert decision is not None and decision.reason == "too large"


def test_a_decision_that_the_reviewer_has_not_seen_is_not_overwritten(
    reviewed: tuple[Client, list[str]], toycar: Workspace
) -> None:
    client, (first, second, *_) = reviewed
    group = next(
        one
        for one in groups_of_library(toycar, toycar.manifest("toycar"), specs=("sensor/*",))
        if one.id == first
    )
    record_actions(
        toycar, "toycar", [ReviewAction(group=group, kind=ReviewActionKind.REJECT, by="John")], {first: ""}
    )
    answer = decided(client, (first, "approve"), (second, "approve"), seen={first: "", second: ""})
    assert answer.status == 409
    assert "John" in answer.json["conflict"]
    assert list(answer.json["groups"]) == [first]
    assert answer.json["groups"][first]["state"] == "rejected"
    assert client.get(f"{API}?spec=sensor/*").json["groups"][second]["state"] == "new"
    assert decided(client, (first, "approve")).status == 200


def test_a_diff_that_the_page_did_not_show_is_not_approved(
    reviewed: tuple[Client, list[str]], toycar: Workspace
) -> None:
    """The target changed after the page was loaded."""
    client, [*names] = reviewed
    before = client.get(f"{API}?spec=sensor/*").json["groups"]
    sensing = toycar.library.parent / "tree/toycar/sensing.py"
    sensing.write_text(sensing.read_text().replace("offset = ", "offset = 0.0 + "))
    now = client.get(f"{API}?spec=sensor/*").json["groups"]
    changed = next(name for name in names if now[name]["digest"] != before[name]["digest"])
    digests = {changed: before[changed]["digest"]}
    answer = decided(client, (changed, "approve"), digests=digests)
    assert answer.status == 409
    assert "the diff has changed" in answer.json["conflict"]
    assert decided(client, (changed, "approve"), digests={changed: now[changed]["digest"]}).status == 200
    assert client.get(f"{API}/{changed}/changes?spec=sensor/*").json == {"changes": ""}


NO_DECISIONS: tuple[tuple[Any, int], ...] = (
    ({}, 400),
    ({"changes": [], "by": "Jane", "seen": {}}, 400),
    ({"changes": [{"group": "ID", "kind": "approve"}], "by": "Jane", "seen": {}}, 400),
    ({"changes": [{"group": "ID", "kind": "approve"}], "by": "Jane", "seen": {"ID": ""}}, 400),
    ({"changes": [{"group": "ID", "kind": "flag"}], "by": " ", "seen": {"ID": ""}}, 400),
    ({"changes": [{"group": "ID", "kind": "flag"}], "by": "a\u0000b", "seen": {"ID": ""}}, 400),
    (
        {"changes": [{"group": "ID", "kind": "remark", "text": " "}], "by": "Jane", "seen": {"ID": ""}},
        400,
    ),
    ({"changes": [{"group": "ID", "kind": "delete"}], "by": "Jane", "seen": {"ID": ""}}, 400),
    ({"changes": [{"group": "../ID", "kind": "approve"}], "by": "Jane", "seen": {"ID": ""}}, 400),
    ({"changes": [{"group": "0" * 12, "kind": "flag"}], "by": "Jane", "seen": {"0" * 12: ""}}, 404),
    ({"changes": [{"group": "ID", "kind": "flag", "by": "me"}], "by": "Jane", "seen": {"ID": ""}}, 400),
    ({"changes": [{"group": "ID", "kind": "flag"}] * 5001, "by": "Jane", "seen": {"ID": ""}}, 400),
)


def test_an_invalid_decision_is_refused(reviewed: tuple[Client, list[str]], toycar: Workspace) -> None:
    client, (first, *_) = reviewed
    for body, status in NO_DECISIONS:
        sent = json.dumps(body).replace("ID", first)
        answer = client.ask("POST", f"{API}?spec=sensor/*", body=sent.encode())
        assert answer.status == status, sent[:200]
    assert not (toycar.library / "reviews").exists()


def test_remarks_are_not_markup(reviewed: tuple[Client, list[str]]) -> None:
    client, (first, *_) = reviewed
    assert decided(client, (first, "approve"), by=HOSTILE, text=f"</script>{HOSTILE}").status == 200
    answer = client.get(f"{API}?spec=sensor/*")
    assert answer.headers["content-type"] == "application/json"
    assert answer.json["groups"][first]["decision"]["by"] == HOSTILE
    page = client.get("/review/toycar?spec=sensor/*")
    assert page.status == 200 and HOSTILE not in page.text
    assert HOSTILE not in client.get(f"/review/toycar?spec={HOSTILE.replace(' ', '%20')}").text
    assert HOSTILE not in client.get(f"/review/toycar?{HOSTILE.replace(' ', '%20')}=1").text


def test_unknown_images_and_runs_are_not_found(reviewed: tuple[Client, list[str]]) -> None:
    client, (first, *_) = reviewed
    assert client.get(f"/review/toycar/{first}/picture/most-after.jpg?spec=sensor/*").status == 404
    assert client.get(f"{API}/{first}/typical?spec=sensor/*&run=none").status == 404
    assert client.get(f"{API}?other=1").status == 400
    assert client.get(f"{API}?campaign=small&spec=sensor/*").status == 400
    assert client.get(f"{API}?{'spec=a&' * 101}").status == 400


def test_a_review_file_cannot_be_a_link(reviewed: tuple[Client, list[str]], toycar: Workspace) -> None:
    client, (first, *_) = reviewed
    other = client.place / "secret.txt"
    other.write_text(SECRET)
    (toycar.library / "reviews").mkdir()
    (toycar.library / "reviews" / "toycar.yaml").symlink_to(other)
    for address in (f"{API}?spec=sensor/*", "/review/toycar?spec=sensor/*"):
        assert client.get(address).status == 400
    change = {"changes": [{"group": first, "kind": "approve"}], "by": "Jane", "seen": {first: ""}}
    assert client.post(f"{API}?spec=sensor/*", change).status == 400
    assert other.read_text() == SECRET
