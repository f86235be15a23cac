"""Reviewers' decisions are stored unchanged under one lock. A decision made from an old view is a
conflict."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from mutator._common import shipped_files
from mutator._common.version import VERSION
from mutator.errors import MutatorError, ReviewConflict, UnsafePath
from mutator.review.mutant_groups import Group
from mutator.review.review_entries import BasisDigests
from mutator.review.review_state_and_actions import (
    Review,
    ReviewAction,
    ReviewActionKind,
    ReviewState,
    load_review,
    record_actions,
)
from mutator.review.reviewed_texts import diff_from_reviewed_text, render_reviewed_text, write_reviewed_text
from mutator.workspace import Workspace

BOUND = BasisDigests(diff="d" * 16, function="f" * 16, template="0" * 16, calls="c" * 16)
VALUES = {"by": (-40.0, 40.0)}


def group(name: str, bound: BasisDigests = BOUND, diff: str = "+x = 1\n") -> Group:
    return Group(
        id=name * 12,
        label=f"group {name}: \"quoted\" 'and' ünï # no comment",
        injection_labels=(),
        files=(),
        functions=(),
        models=(),
        trigger_kinds="state",
        hold_kinds="while",
        shapes=(),
        faults=(),
        triggers=(),
        experiment_count=None,
        basis_digests=bound,
        value_ranges=VALUES,
        reviewed_text=render_reviewed_text(bound, VALUES, {"diff": diff}),
    )


def say(toy: Workspace, kind: ReviewActionKind, *names: str, by: str = "Jane Doe", text: str = "") -> Review:
    changes = [ReviewAction(group=group(name), kind=kind, by=by, text=text) for name in names]
    review = load_review(toy, "toycar")
    return record_actions(
        toy, "toycar", changes, {one.group.id: review.revision(one.group.id) for one in changes}
    )


def test_decisions_and_remarks_round_trip(toycar: Workspace) -> None:
    say(toycar, ReviewActionKind.APPROVE, "b", "0", text="fine")
    say(toycar, ReviewActionKind.REJECT, "1", by="Ünï 'x' # \"y\"", text="a: b\\n")
    say(toycar, ReviewActionKind.REMARK, "a", text="- [not yaml]")
    written = say(toycar, ReviewActionKind.FLAG, "0", by="Joe")
    read = load_review(toycar, "toycar")
    assert read == written
    assert [read.revision(name) for name in read.entry_by_group] == [
        written.revision(name) for name in written.entry_by_group
    ]
    decision = read.decision("b" * 12)
    assert decision is not None
    assert (decision.by, decision.tool, decision.commit, decision.bound) == ("Jane Doe", VERSION, None, BOUND)
    assert [(one.by, one.text) for one in read.remarks("b" * 12)] == [("Jane Doe", "fine")]
    flag = read.flag("0" * 12)
    assert flag is not None and flag.by == "Joe" and flag.at == decision.at[:11] + flag.at[11:]  # type: ignore[index]


def test_a_group_is_new_decided_or_changed(toycar: Workspace) -> None:
    say(toycar, ReviewActionKind.APPROVE, "a")
    found = say(toycar, ReviewActionKind.REJECT, "b")
    other = replace(BOUND, function="e" * 16, template="1" * 16, calls="2" * 16)
    states = [found.state(g) for g in (group("c"), group("a", other), group("b"), group("a"))]
    assert states == list(ReviewState)
    assert found.in_list_order([group("a"), group("b"), group("c")]) == [group("c"), group("b"), group("a")]
    assert found.stale_parts(group("a", other)) == ["template", "target function", "called code"]
    assert found.describe_decision(group("a", other)).endswith(
        " (changed since: template, target function, called code)"
    )
    assert found.describe_decision(group("b")).startswith("rejected by Jane Doe on 20")
    assert found.describe_decision(group("c")) == ""


@pytest.mark.parametrize(
    ("values", "changed"),
    [
        ({"by": (-40.0, 40.0)}, []),
        ({"by": (3.0, 3.0)}, []),
        ({}, []),
        ({"by": (-100.0, 40.0)}, ["values (by: -100 to 40; approved -40 to 40)"]),
        ({"by": (41.0, 41.0), "low": (0.0, 0.0)}, [
            "values (by: 41; approved -40 to 40; low: 0; approved none)"
        ]),
        ({"by": (1.0, 2.0, "nan")}, ["values (by: 1 to 2, nan; approved -40 to 40)"]),
    ],
)  # fmt: skip
def test_values_must_lie_within_the_approved_ones(
    toycar: Workspace, values: dict[str, tuple[float | str, ...]], changed: list[str]
) -> None:
    found = say(toycar, ReviewActionKind.APPROVE, "a")
    assert found.stale_parts(replace(group("a"), value_ranges=values)) == changed


def test_a_new_decision_replaces_the_old_one(toycar: Workspace) -> None:
    say(toycar, ReviewActionKind.APPROVE, "a", text="fine")
    found = say(toycar, ReviewActionKind.REJECT, "a", by="Joe", text="no")
    assert found.describe_decision(group("a")).startswith("rejected by Joe")
    assert [one.text for one in found.remarks("a" * 12)] == ["fine", "no"]
    assert len(found.entry_by_group) == 1


def test_a_cleared_decision_is_deleted(toycar: Workspace) -> None:
    say(toycar, ReviewActionKind.APPROVE, "a", "b", text="fine")
    say(toycar, ReviewActionKind.FLAG, "c")
    found = say(toycar, ReviewActionKind.CLEAR, "a")
    assert found.state(group("a")) is ReviewState.NEW and found.remarks("a" * 12)
    assert "c" * 12 not in say(toycar, ReviewActionKind.UNFLAG, "c").entry_by_group
    assert found.revision("c" * 12) and load_review(toycar, "toycar").revision("c" * 12) == ""


def test_a_decision_from_an_old_view_writes_nothing(toycar: Workspace) -> None:
    before = load_review(toycar, "toycar")
    say(toycar, ReviewActionKind.REJECT, "a", by="Joe", text="too much")
    changes = [
        ReviewAction(group=group(name), kind=ReviewActionKind.APPROVE, by="Jane") for name in ("a", "b")
    ]
    with pytest.raises(ReviewConflict, match=r"aaaaaaaaaaaa  rejected by Joe on .*Joe: too much") as caught:
        record_actions(toycar, "toycar", changes, {g: before.revision(g) for g in ("a" * 12, "b" * 12)})
    assert caught.value.groups == ("a" * 12,)
    assert caught.value.review == load_review(toycar, "toycar")
    assert caught.value.review.state(group("b")) is ReviewState.NEW


def test_different_groups_never_conflict(toycar: Workspace) -> None:
    say(toycar, ReviewActionKind.REJECT, "a", by="Joe")
    found = record_actions(
        toycar, "toycar", [ReviewAction(group=group("b"), kind=ReviewActionKind.APPROVE, by="Jane")], {}
    )
    assert [found.state(group(name)) for name in "ab"] == [ReviewState.REJECTED, ReviewState.APPROVED]


_WRITER = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from test_review_state_and_actions import ReviewAction, ReviewActionKind, Workspace, group, record_actions
library, by = Path(sys.argv[2]), sys.argv[3]
toy = Workspace(library=library, templates=library.parent / "templates")
print("ready", flush=True)
sys.stdin.readline()
for name in sys.argv[4]:
    action = ReviewAction(group=group(name), kind=ReviewActionKind.APPROVE, by=by)
    record_actions(toy, "toycar", [action], {})
"""


def test_two_writers_at_once_lose_nothing(toycar: Workspace) -> None:
    words = [sys.executable, "-c", _WRITER, str(Path(__file__).parent), str(toycar.library)]
    shares = {"Jane": "02468ace", "Joe": "13579bdf"}
    with_pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "env": dict(os.environ)}
    writers = [
        subprocess.Popen([*words, by, names], **with_pipes)  # type: ignore[call-overload]
        for by, names in shares.items()
    ]
    for writer in writers:
        assert writer.stdout.readline() == b"ready\n"
    for writer in writers:
        writer.stdin.write(b"\n")
        writer.stdin.flush()
    assert [writer.wait(60) for writer in writers] == [0, 0]
    for writer in writers:
        writer.stdin.close()
        writer.stdout.close()
    found = load_review(toycar, "toycar")
    assert {name[0]: found.entry_by_group[name].decision.by for name in found.entry_by_group} == {  # type: ignore[union-attr]
        name: by for by, names in shares.items() for name in names
    }


def test_each_hunk_names_its_section_and_function(tmp_path: Path) -> None:
    body = "".join(f"{i}\n" for i in range(9))

    def text(value: int) -> str:
        calls = f"-- car/a.py A\n{body}-- car/b.py B\n{body}y = {value}\n"
        return render_reviewed_text(BOUND, {}, {"diff": f"-- a\n{body}+x = {value}\n", "calls": calls})

    write_reviewed_text(tmp_path, "a.txt", text(1))
    diff = diff_from_reviewed_text(tmp_path, "a.txt", BOUND, text(2))
    hunks = [line for line in diff.splitlines() if line.startswith("@@")]
    assert [line.rpartition("@@ ")[2] for line in hunks] == ["diff", "calls: car/b.py B"]


@pytest.mark.parametrize("name", ["", "toycar.yaml", "seen", "seen/toycar"])
@pytest.mark.parametrize("is_there", [True, False])
def test_nothing_is_read_or_written_through_a_link_of_the_library(
    toycar: Workspace, tmp_path: Path, name: str, is_there: bool
) -> None:
    mine, link = tmp_path / "mine", toycar.library / "reviews" / name
    mine.mkdir()
    end = mine / "notes.yaml" if name == "toycar.yaml" else mine
    if is_there:
        (mine / "notes.yaml").write_text("my secret: [\n")
    elif name != "toycar.yaml":
        mine.rmdir()
    before = sorted((path, path.read_text()) for path in mine.glob("*"))
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(end)
    with pytest.raises(UnsafePath) as caught:
        say(toycar, ReviewActionKind.APPROVE, "a")
    assert "secret" not in str(caught.value)
    assert sorted((path, path.read_text()) for path in mine.glob("*")) == before
    assert not (toycar.library / "reviews" / "toycar.yaml").is_file() or name == "toycar.yaml"


def test_a_target_whose_name_leads_out_has_no_reviews(toycar: Workspace) -> None:
    with pytest.raises(UnsafePath):
        load_review(toycar, "../../notes")


def test_a_changed_group_shows_the_diff_since_its_approval(toycar: Workspace) -> None:
    found = say(toycar, ReviewActionKind.APPROVE, "a")
    now = group("a", replace(BOUND, diff="e" * 16), "+x = 2\n")
    assert found.diff_since_decision(group("a")) == ""
    assert "-+x = 1\n++x = 2\n" in found.diff_since_decision(now)
    path = toycar.library / "reviews" / "seen" / "toycar" / f"{'a' * 12}.txt"
    text = path.read_text()
    path.write_text(text.replace("d" * 16, "9" * 16))
    assert found.diff_since_decision(now) == ""  # the stored text belongs to another decision
    path.unlink()
    assert found.diff_since_decision(now) == ""
    assert found.state(now) is ReviewState.CHANGED


@pytest.mark.parametrize(
    ("kind", "by", "text", "argument"),
    [
        (ReviewActionKind.APPROVE, "", "", "by"),
        (ReviewActionKind.FLAG, " \n", "", "by"),
        (ReviewActionKind.REJECT, "J", "a\0b", "text"),
        (ReviewActionKind.REMARK, "J", " ", "text"),
    ],
)
def test_an_empty_name_or_an_invalid_text_is_refused(
    toycar: Workspace, kind: ReviewActionKind, by: str, text: str, argument: str
) -> None:
    with pytest.raises(MutatorError) as caught:
        record_actions(toycar, "toycar", [ReviewAction(group=group("a"), kind=kind, by=by, text=text)], {})
    assert caught.value.argument == argument
    assert not (toycar.library / "reviews").exists()


def test_a_remark_is_one_line(toycar: Workspace) -> None:
    found = say(toycar, ReviewActionKind.REMARK, "a", text="one\n two\ttabs")
    assert found.remarks("a" * 12)[0].text == "one two tabs"


def test_a_failed_write_leaves_the_old_file(toycar: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    path = say(toycar, ReviewActionKind.APPROVE, "a").path
    before = path.read_bytes()

    def full(*names: str, **folders: int) -> None:
        raise OSError("no")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="no"):
        say(toycar, ReviewActionKind.FLAG, "b")
    assert path.read_bytes() == before
    assert sorted(one.name for one in path.parent.iterdir()) == ["seen", "toycar.yaml"]


def test_a_library_from_a_wheel_cannot_store_decisions(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shipped_files, "SHIPPED_ARCHIVE_PATH", tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "cache"))
    library = tmp_path / "cache" / "mutator" / "shipped" / "0"
    with pytest.raises(MutatorError, match=r"reviews/toycar.yaml: .*ships with mutator.*mutator init DIR"):
        say(replace(toycar, library=library), ReviewActionKind.APPROVE, "a")
    assert not (tmp_path / "cache").exists()
