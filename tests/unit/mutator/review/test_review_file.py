"""The review file."""

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from mutator._common.hashing import as_json_types
from mutator.errors import MutatorError
from mutator.review import review_file
from mutator.review.review_entries import (
    BasisDigests,
    DecisionVerdict,
    Flag,
    GroupDecision,
    Remark,
    ReviewEntry,
)
from mutator.review.review_file import ReviewFileContent

BOUND = BasisDigests(diff="d" * 16, function="f" * 16, template="0" * 16, calls="c" * 16)
AT = "2026-11-24T16:00:00Z"


def entry(name: str) -> ReviewEntry:
    decision = GroupDecision(
        group=name * 12,
        what=f"group {name}",
        verdict=DecisionVerdict.APPROVED,
        by="Jane Doe",
        at=AT,
        commit="1" * 40 + "-dirty",
        tool="0.2.0",
        bound=BOUND,
        values={"by": (-1e-9, 1e22), "to": (0.0, 0.0, "nan")},
    )
    remarks = (Remark(by="Joe", at=AT, text="why?"), Remark(by="Jane", at=None, text="{so: \"'}"))
    flag = Flag(by="Joe", at=AT)
    return ReviewEntry(group=name * 12, what=f"group {name}", decision=decision, remarks=remarks, flag=flag)


def written(path: Path, *names: str) -> Path:
    entries = {name * 12: entry(name) for name in names}
    path.write_text(
        review_file.render_review_file("toycar", ReviewFileContent(entry_by_group=entries, four_eyes=True))
    )
    return path


def test_a_review_file_round_trips(tmp_path: Path) -> None:
    path = written(tmp_path / "toycar.yaml", "b", "a")
    found = review_file.load_review_file(path, "toycar")
    assert found == ReviewFileContent(
        entry_by_group={name * 12: entry(name) for name in "ab"}, four_eyes=True
    )
    text = path.read_text()
    path.write_text(review_file.render_review_file("toycar", found))
    assert path.read_text() == text


def test_a_reason_is_stored_with_its_rejection(tmp_path: Path) -> None:
    decision = entry("a").decision
    assert decision is not None
    rejected = replace(decision, verdict=DecisionVerdict.REJECTED, reason='Ünï: #1 "y"')
    entries = {"a" * 12: replace(entry("a"), decision=rejected)}
    path = tmp_path / "toycar.yaml"
    path.write_text(review_file.render_review_file("toycar", ReviewFileContent(entry_by_group=entries)))
    assert review_file.load_review_file(path, "toycar").entry_by_group == entries
    assert as_json_types(rejected)["reason"] == rejected.reason
    assert "reason" not in as_json_types(decision)  # so approvals keep their digest


def test_decisions_about_different_groups_merge(tmp_path: Path) -> None:
    files = [written(tmp_path / f"{i}", *names) for i, names in enumerate(("018f", "08f", "08ef"))]
    merged = subprocess.run(["git", "merge-file", "-p", *files], capture_output=True, check=True).stdout
    (path := tmp_path / "toycar.yaml").write_bytes(merged)
    assert "".join(name[0] for name in review_file.load_review_file(path, "toycar").entry_by_group) == "018ef"


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("approved", "aproved", 9, "aproved"),
        ('"aaaaaaaaaaaa"', '"aaaa"', 7, "aaaa"),
        ('ffff"', 'zzzz"', 15, "zzzz"),
        ('"Jane Doe"', '""', 10, "by"),
        ('"Jane Doe"', "3", 10, "3"),
        ("remarks:", "remark:", 20, "remark"),
        ('"why?"', '" "', 21, "text"),
        (AT, "yesterday", 11, "yesterday"),
        ("[-1e-09, 1e+22]", "wide", 18, "wide"),
        ("toycar", "other", 4, "other"),
        ("four_eyes: true", "four_eyes: 4", 5, "4"),
        ("review/2", "review/3", 3, "newer version"),
        ("review/2", "review/1", 3, "expected review/2; start the file with `schema: review/2`"),
        ("review/2", "[]", 3, "schema []"),
        ("decisions:", "decisions: [", 7, "YAML"),
        ('"bbbbbbbbbbbb"', '"aaaaaaaaaaaa"', 23, "appears twice"),
        ('    decision: "approved"\n', "", 9, "'by' without a decision"),
        ('    by: "Jane Doe"\n', "", 7, "a decision without `by`"),
        ("    commit:", '    reason: "too large"\n    commit:', 12, "a reason for an approval"),
    ],
)
def test_mistakes_are_reported_with_their_line(
    tmp_path: Path, old: str, new: str, line: int, words: str
) -> None:
    path = written(tmp_path / "toycar.yaml", "a", "b")
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(MutatorError) as caught:
        review_file.load_review_file(path, "toycar")
    assert (caught.value.where, caught.value.line) == (str(path), line)
    assert words in str(caught.value)
