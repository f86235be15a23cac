"""The review file, in its current and its old format."""

import shutil
import subprocess
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.review import review_file
from mutator.review.entries import Bound, Decision, Entry, Flag, Remark, Verdict
from mutator.review.review_file import Content

BOUND = Bound(diff="d" * 16, function="f" * 16, template="0" * 16, calls="c" * 16)
AT = "2026-11-24T16:00:00Z"
OLD = Path(__file__).parents[3] / "fixtures" / "run-3" / "toy" / "fault_library" / "reviews" / "toycar.yaml"


def entry(name: str) -> Entry:
    decision = Decision(
        group=name * 12,
        what=f"group {name}",
        verdict=Verdict.APPROVED,
        by="Jane Doe",
        at=AT,
        commit="1" * 40 + "-dirty",
        tool="0.2.0",
        bound=BOUND,
        values={"by": (-1e-9, 1e22), "to": (0.0, 0.0, "nan")},
    )
    remarks = (Remark(by="Joe", at=AT, text="why?"), Remark(by="Jane", at=None, text="{so: \"'}"))
    flag = Flag(by="Joe", at=AT)
    return Entry(group=name * 12, what=f"group {name}", decision=decision, remarks=remarks, flag=flag)


def written(path: Path, *names: str) -> Path:
    entries = {name * 12: entry(name) for name in names}
    path.write_text(review_file.text("toycar", Content(entries=entries, four_eyes=True)))
    return path


def test_a_review_file_round_trips(tmp_path: Path) -> None:
    path = written(tmp_path / "toycar.yaml", "b", "a")
    found = review_file.load(path, "toycar")
    assert found == Content(entries={name * 12: entry(name) for name in "ab"}, four_eyes=True)
    text = path.read_text()
    path.write_text(review_file.text("toycar", found))
    assert path.read_text() == text


def test_decisions_about_different_groups_merge(tmp_path: Path) -> None:
    files = [written(tmp_path / f"{i}", *names) for i, names in enumerate(("018f", "08f", "08ef"))]
    merged = subprocess.run(["git", "merge-file", "-p", *files], capture_output=True, check=True).stdout
    (path := tmp_path / "toycar.yaml").write_bytes(merged)
    assert "".join(name[0] for name in review_file.load(path, "toycar").entries) == "018ef"


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
        ("review/2", "[]", 3, "schema []"),
        ("decisions:", "decisions: [", 7, "YAML"),
        ('"bbbbbbbbbbbb"', '"aaaaaaaaaaaa"', 23, "appears twice"),
        ('    decision: "approved"\n', "", 9, "'by' without a decision"),
        ('    by: "Jane Doe"\n', "", 7, "a decision without `by`"),
    ],
)
def test_mistakes_are_reported_with_their_line(
    tmp_path: Path, old: str, new: str, line: int, words: str
) -> None:
    path = written(tmp_path / "toycar.yaml", "a", "b")
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(MutatorError) as caught:
        review_file.load(path, "toycar")
    assert (caught.value.where, caught.value.line) == (str(path), line)
    assert words in str(caught.value)


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A file with schema `review/1`: three changes, each under two kinds of triggers, and the probe, all
    approved."""
    return shutil.copy(OLD, tmp_path / "toycar.yaml")


def edited(path: Path, group: str, old: str, new: str) -> dict[str, Entry]:
    head, block, rest = path.read_text().partition(f'group: "{group}"')
    assert old in rest
    path.write_text(head + block + rest.replace(old, new, 1))
    return {one.what: one for one in review_file.load(path, "toycar").entries.values()}


SENSE = "toycar/sensing.py Sensor.sense"
GAP = f"{SENSE} after_assign gap: offset(by, low, target=gap)"
OFFSET = f"{SENSE} after_assign offset: offset(by, target=offset)"
SILENCE = f"{SENSE} before_call self.publish: omission()"
PROBE = "the probe, observing at toycar/go.py Drive.step after_assign now"


def test_an_old_file_has_a_decision_for_each_change(old: Path) -> None:
    """A change is approved if it was approved under each kind of trigger."""
    found = {one.what: one for one in review_file.load(old, "toycar").entries.values()}
    assert set(found) == {GAP, OFFSET, SILENCE, PROBE}
    decision = found[OFFSET].decision
    assert decision is not None
    assert (decision.verdict, decision.by, decision.at) == (Verdict.APPROVED, "Jane Doe", None)
    assert decision.bound == Bound(
        diff="119123172159a027", function="3eff22e1db4eaddf", template="3307b2f6026230e8", calls=None
    )
    assert decision.values is None
    assert found[PROBE].decision is not None and found[PROBE].decision.by == "reader"


def test_an_old_rejection_applies_under_any_trigger(old: Path) -> None:
    edited(old, "d32713d465f1", "approved", "rejected")
    found = edited(old, "d32713d465f1", "Jane Doe", "Joe")[OFFSET].decision
    assert found is not None and (found.verdict, found.by) == (Verdict.REJECTED, "Joe")


def test_old_approvals_of_different_diffs_are_invalid(old: Path) -> None:
    found = edited(old, "50d62901775b", "119123172159a027", "9" * 16)[OFFSET].decision
    assert found is not None
    assert found.bound == Bound(diff="0" * 16, function="3eff22e1db4eaddf", template="3307b2f6026230e8")


def test_old_remarks_are_kept(old: Path) -> None:
    edited(old, "4f924f1dc5e6", 'remark: ""', 'remark: "once"')
    edited(old, "6ee7b871b4c7", 'remark: ""', 'remark: "twice"')
    entry = edited(old, "6ee7b871b4c7", "Jane Doe", "Joe")[SILENCE]
    assert {(one.by, one.text, one.at) for one in entry.remarks} == {
        ("Jane Doe", "once", None),
        ("Joe", "twice", None),
    }
    assert entry.decision is not None and entry.decision.by == "Jane Doe and Joe"


def test_a_mistake_in_an_old_file_is_reported_at_its_line(old: Path) -> None:
    with pytest.raises(MutatorError, match=r"toycar\.yaml:8: 'aproved' for 'decision'"):
        edited(old, "08a4799889df", "approved", "aproved")
    old.write_text('schema: review/1\ntarget: "toycar"\ndecisions: 1.5\n')
    with pytest.raises(MutatorError, match=r"toycar\.yaml:3: 1\.5 for 'decisions'"):
        review_file.load(old, "toycar")


def test_writing_upgrades_the_file(old: Path) -> None:
    found = review_file.load(old, "toycar")
    old.write_text(review_file.text("toycar", found))
    assert f"schema: {review_file.SCHEMA}\n" in old.read_text()
    assert review_file.load(old, "toycar") == found
