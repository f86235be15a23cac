"""The head of a run folder is a typed record; what does not fit is refused by its key."""

import dataclasses
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorError, UnsafePath
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import RunHead, load_head
from mutator.targets.stored_target_facts import TargetFacts
from mutator.workspace import Workspace
from tests.made_head import made_head

OTHERS = (3, -0.5, "x\x1b[2J", True, None, [], [[3]], {"a": {"b": None}})


@pytest.fixture
def run(toycar: Workspace, tmp_path: Path, write_finished: Callable[..., Path]) -> Path:
    return write_finished(toycar, tmp_path / "run", campaign="small", limit=3)


def values(content: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield the path to each key, and to the first item of each list. The canary and the structure have
    readers of their own."""
    if path:
        yield path
    if path in (("canary",), ("structure",)):
        return
    if isinstance(content, dict):
        for key in content:
            yield from values(content[key], (*path, key))
    elif content and isinstance(content, list):
        yield from values(content[0], (*path, 0))


def put(content: Any, path: tuple[str | int, ...], value: object) -> Any:
    if not path:
        return value
    copy = content.copy()
    copy[path[0]] = put(content[path[0]], path[1:], value)
    return copy


def test_a_head_is_written_as_it_was_read(run: Path) -> None:
    """The seal covers its bytes, also those of keys that a later version adds."""
    path = run / "run.json"
    assert load_head(run).file_bytes() == path.read_bytes()
    written = json.dumps(json.loads(path.read_text()) | {"a_later_key": [1]}, indent=1, ensure_ascii=False)
    path.write_text(written + "\n")
    assert load_head(run).file_bytes() == path.read_bytes()


def test_optional_keys_and_those_of_the_target_have_their_place(toycar: Workspace, tmp_path: Path) -> None:
    path = toycar.library / "campaigns" / "small.yaml"
    lines = [line for line in path.read_text().splitlines() if not line.startswith("seed:")]
    path.write_text("\n".join([*lines, "seeds: {from: 3, to: 4}", ""]))
    folder = freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)
    keys = list(json.loads((folder.path / "run.json").read_text()))
    assert keys[keys.index("seed") : keys.index("choices")] == ["seed", "seeds", "reading"]
    of_target = [field.name for field in dataclasses.fields(TargetFacts) if field.name != "speed"]
    assert (keys[0], keys[keys.index("limits") + 1 : keys.index("phrases")]) == ("schema", of_target)
    assert folder.head.seeds == (3, 4)


def test_a_value_of_another_type_is_refused_by_its_key(run: Path) -> None:
    """Whatever is accepted instead is written again as it was read."""
    path, original = run / "run.json", json.loads((run / "run.json").read_text())
    tried = accepted = 0
    for number, place in enumerate(values(original)):
        for turn in range(2):  # two of the values for each place
            value = OTHERS[(2 * number + turn) % len(OTHERS)]
            content = put(original, place, value)
            path.write_text(json.dumps(content))
            tried += 1
            try:
                found = load_head(run)
            except MutatorError as err:
                text = str(err)
                assert text.startswith(f"{path}: ") and text.isprintable() and err.remedy
                assert f"'{place[0]}'" in text or place[0] in ("schema", "golden_files", "target", "goldens")
            else:
                accepted += 1
                assert json.loads(found.file_bytes()) == content
    assert tried > 150 and accepted < tried / 5


def test_each_key_is_needed_unless_it_is_optional(run: Path) -> None:
    path, original = run / "run.json", json.loads((run / "run.json").read_text())
    optional = {
        "seeds",
        "operators",
        "include",
        "bench",
        "defences",
        "speed",
        "phrases",
        "scenarios",
        "families",
        "keys_of_later_versions",
    }
    assert {field.name for field in dataclasses.fields(RunHead)} - optional == original.keys() - optional
    for key in original.keys() - {"schema", *optional}:
        path.write_text(json.dumps({name: value for name, value in original.items() if name != key}))
        with pytest.raises(MutatorError, match=f"no key '{key}'; expected a complete run.json"):
            RunFolder.open_unverified(run)


def test_names_in_the_head_lead_nowhere(tmp_path: Path) -> None:
    for change in ({"target": "../x.yaml"}, {"golden_files": ["../x"]}, {"goldens": [["x.yaml", []]]}):
        (tmp_path / "run.json").write_text(json.dumps(made_head(**change)))
        with pytest.raises(UnsafePath, match=r"run\.json"):
            load_head(tmp_path)
