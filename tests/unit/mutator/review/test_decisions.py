"""The file of decisions: it holds what was decided; a mistake is reported at its line."""

import dataclasses
import subprocess
from pathlib import Path

import pytest

from mutator._common import shipped
from mutator.errors import MutatorError
from mutator.review.catalogue import Bound, Group
from mutator.review.decisions import Review, State, Verdict, load_review
from mutator.workspace import Workspace

BOUND = Bound(diff="d" * 16, function="f" * 16, template="0" * 16)


def group(name: str, bound: Bound = BOUND) -> Group:
    return Group(
        id=name * 12,
        what=f"group {name}: \"quoted\" 'and' ünï # no comment",
        injections=(),
        files=(),
        functions=(),
        models=(),
        trigger="state",
        hold="while",
        shapes=(),
        faults=(),
        triggers=(),
        runs=None,
        bound=bound,
    )


def review(toy: Workspace, *names: str) -> Review:
    return load_review(toy, "toycar").decided(map(group, names), Verdict.APPROVED, "Jane Doe", "fine")


def test_what_is_written_is_read(toycar: Workspace) -> None:
    """Names and remarks of any letters come back, and the file says the same each time."""
    written = review(toycar, "b", "0", "1").decided(
        [group("1")], Verdict.REJECTED, "Ünï 'x' # \"y\"", "a: b\\n"
    )
    written.write()
    assert load_review(toycar, "toycar") == written
    text = written.path.read_text()
    load_review(toycar, "toycar").write()
    assert written.path.read_text() == text


def test_states(toycar: Workspace) -> None:
    """New until decided, then what was decided, changed once anything that it was bound to is another."""
    found = review(toycar, "a").decided([group("b")], Verdict.REJECTED, "Jane", "")
    other = Bound(diff=BOUND.diff, function="e" * 16, template="1" * 16)
    states = [found.state(g) for g in (group("c"), group("a", other), group("b"), group("a"))]
    assert states == list(State)
    assert found.in_turn([group("a"), group("b"), group("c")]) == [group("c"), group("b"), group("a")]
    assert (
        found.describe(group("a", other))
        == "approved by Jane Doe: fine (changed since: template, target function)"
    )
    assert (found.describe(group("b")), found.describe(group("c"))) == ("rejected by Jane", "")


def test_a_new_decision_takes_the_old_ones_place(toycar: Workspace) -> None:
    """A group has one block in the file."""
    found = review(toycar, "a").decided([group("a")], Verdict.REJECTED, "Joe", "no")
    assert found.describe(group("a")) == "rejected by Joe: no"
    assert len(found.decisions) == 1


def test_blocks_are_sorted_one_fact_a_line(toycar: Workspace) -> None:
    """Decisions of two people about different groups merge under version control."""
    base, ours, theirs = (review(toycar, *names) for names in ("08f", "018f", "08ef"))
    folder = base.path.parent
    files = []
    for i, one in enumerate((ours, base, theirs)):
        one.write()
        files.append(folder / f"{i}")
        one.path.rename(files[-1])
    merged = subprocess.run(["git", "merge-file", "-p", *files], capture_output=True, check=True).stdout
    base.path.write_bytes(merged)
    assert "".join(name[0] for name in load_review(toycar, "toycar").decisions) == "018ef"


def test_no_file_is_no_decision(toycar: Workspace) -> None:
    """A library without reviews has none."""
    assert not load_review(toycar, "toycar").decisions


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("approved", "aproved", 8, "aproved"),
        ('"aaaaaaaaaaaa"', '"aaaa"', 6, "aaaa"),
        ('ffff"', 'zzzz"', 12, "zzzz"),
        ('"Jane Doe"', '""', 9, "by"),
        ('"Jane Doe"', "3", 9, "3"),
        ("remark:", "remarks:", 10, "remarks"),
        ("toycar", "other", 4, "other"),
        ("review/1", "review/2", 3, "newer version"),
        ("decisions:", "decisions: [", 6, "YAML"),
        ('"bbbbbbbbbbbb"', '"aaaaaaaaaaaa"', 14, "second time"),
    ],
)
def test_hand_edits_are_checked(toycar: Workspace, old: str, new: str, line: int, words: str) -> None:
    """A mistake is told with the file, its line and the offending value."""
    found = review(toycar, "a", "b")
    found.write()
    found.path.write_text(found.path.read_text().replace(old, new, 1))
    with pytest.raises(MutatorError) as caught:
        load_review(toycar, "toycar")
    assert (caught.value.where, caught.value.line) == (str(found.path), line)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("by", "remark", "argument"), [("", "", "by"), (" \n", "", "by"), ("J", "a\0b", "remark")]
)
def test_no_name_or_no_text(toycar: Workspace, by: str, remark: str, argument: str) -> None:
    """A decision has somebody's name, and what is kept of it is text."""
    with pytest.raises(MutatorError) as caught:
        load_review(toycar, "toycar").decided([group("a")], Verdict.APPROVED, by, remark)
    assert caught.value.argument == argument


def test_a_remark_is_one_line(toycar: Workspace) -> None:
    """Line ends become spaces."""
    found = load_review(toycar, "toycar").decided([group("a")], Verdict.APPROVED, "J", "one\n two\ttabs")
    assert found.decisions["a" * 12].remark == "one two tabs"


def test_it_is_written_whole_or_not_at_all(toycar: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    """A write that fails leaves the old file, and nothing beside it."""
    review(toycar, "a").write()
    before = review(toycar).path.read_bytes()

    def full(self: Path, target: Path) -> None:
        raise OSError("no")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="no"):
        review(toycar, "b").write()
    assert review(toycar).path.read_bytes() == before
    assert [path.name for path in review(toycar).path.parent.iterdir()] == ["toycar.yaml"]


def test_the_shipped_library_takes_no_decisions(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Decisions about the library that came with a wheel are refused before anything is written."""
    monkeypatch.setattr(shipped, "ARCHIVE", tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "cache"))
    path = tmp_path / "cache" / "mutator" / "shipped" / "0" / "reviews" / "toycar.yaml"
    with pytest.raises(MutatorError, match=r"reviews/toycar.yaml: .*ships with mutator.*mutator init DIR"):
        dataclasses.replace(review(toycar, "a"), path=path).write()
    assert not (tmp_path / "cache").exists()
