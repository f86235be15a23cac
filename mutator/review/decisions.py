"""Decisions, remarks and flags on groups of mutants: when they are valid, and how they are stored.

A decision is bound to what the reviewer saw: the group's diff, the target's functions, the templates, the
code that injected lines call, and the range of each value. If one of these changes, the group is `changed`
and needs a new decision.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from mutator._common.confined_files import open_below, path_below, write_below
from mutator._common.files import make_folder
from mutator._common.folder_locks import locking_folder
from mutator._common.shipped_files import check_not_shipped
from mutator._common.version import VERSION
from mutator.errors import MutatorError, ReviewConflict
from mutator.review import review_file, seen_texts
from mutator.review.commits import check_four_eyes, library_commit
from mutator.review.entries import Decision, Entry, Flag, Remark, Verdict
from mutator.review.mutant_groups import Group
from mutator.workspace import Workspace

_FOLDER = "reviews"  # in the library


class State(StrEnum):
    """The state of a group's review, in list order."""

    NEW = "new"  # no decision
    CHANGED = "changed"  # since the decision
    REJECTED = "rejected"
    APPROVED = "approved"


class Kind(StrEnum):
    """An action of a reviewer on a group."""

    APPROVE = "approve"
    REJECT = "reject"
    CLEAR = "clear"  # withdraw the decision
    REMARK = "remark"
    FLAG = "flag"
    UNFLAG = "unflag"


_VERDICTS = {Kind.APPROVE: Verdict.APPROVED, Kind.REJECT: Verdict.REJECTED}


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """An action of the reviewer `by` on a group in its current state. `text` is stored as a remark."""

    group: Group
    kind: Kind
    by: str
    text: str = ""


@dataclass(frozen=True, kw_only=True)
class Review:
    """The reviews of one target's groups, by group, in a library.

    With `four_eyes`, the author of a group's last change cannot approve it.
    """

    library: Path
    target: str
    entries: Mapping[str, Entry]
    four_eyes: bool = False

    @property
    def path(self) -> Path:
        """The file, which might not exist."""
        return path_below(self.library, _name_of(self.target))

    def decision(self, group: str) -> Decision | None:
        entry = self.entries.get(group)
        return entry.decision if entry else None

    def remarks(self, group: str) -> tuple[Remark, ...]:
        """Return the group's remarks, oldest first."""
        entry = self.entries.get(group)
        return entry.remarks if entry else ()

    def flag(self, group: str) -> Flag | None:
        entry = self.entries.get(group)
        return entry.flag if entry else None

    def revision(self, group: str) -> str:
        """Digest of the group's review; empty if there is none."""
        entry = self.entries.get(group)
        return entry.revision if entry else ""

    def changed(self, group: Group) -> list[str]:
        """Return the parts of a group that changed since the decision, as text."""
        decision = self.decision(group.id)
        return decision.changed(group.bound, group.values) if decision else []

    def state(self, group: Group) -> State:
        decision = self.decision(group.id)
        if decision is None:
            return State.NEW
        return State.CHANGED if self.changed(group) else State(decision.verdict.value)

    def changes(self, group: Group) -> str:
        """Return a unified diff from what the reviewer saw to the current state; empty if the decision is
        valid, or if what the reviewer saw was not stored.
        """
        decision = self.decision(group.id)
        if decision is None or not self.changed(group):
            return ""
        return seen_texts.changes(self.library, self.seen_name(group.id), decision.bound, group.seen)

    def seen_name(self, group: str) -> str:
        """Return the file in the library with the text of a group that the reviewer saw."""
        return f"{_FOLDER}/seen/{self.target}/{group}.txt"

    def in_turn(self, groups: Iterable[Group]) -> list[Group]:
        """Return the groups in list order: new and changed ones first."""
        order = list(State)
        return sorted(groups, key=lambda group: order.index(self.state(group)))

    def describe(self, group: Group) -> str:
        """Return the decision about the group and what changed since, as text; empty without a decision."""
        decision = self.decision(group.id)
        if decision is None:
            return ""
        changed = self.changed(group)
        since = f" (changed since: {', '.join(changed)})" if changed else ""
        older = "" if decision.bound.calls else " (made before called code and values were stored)"
        return decision.words + since + older


def load_review(workspace: Workspace, target: str) -> Review:
    """Load the reviews of a target's groups; empty if there is no file. MutatorError, with the line, for a
    mistake. Links are refused: errors would reveal the linked file, and a change would replace the link.
    """
    library, name = workspace.library, _name_of(target)
    try:
        open_below(library, name).close()
    except FileNotFoundError:
        return Review(library=library, target=target, entries={})
    content = review_file.load(path_below(library, name), target)
    return Review(library=library, target=target, entries=content.entries, four_eyes=content.four_eyes)


def _name_of(target: str) -> str:
    """Return the file of a target's reviews in the library."""
    return f"{_FOLDER}/{target}.yaml"


def record(workspace: Workspace, target: str, changes: Sequence[Change], seen: Mapping[str, str]) -> Review:
    """Apply all changes or none, and return the stored review.

    `seen` are the revisions of the groups that the caller saw (`Review.revision`; missing groups had no
    review). A lock serializes callers across processes. ReviewConflict if somebody else has changed the
    review of one of the groups since; MutatorError for an unusable name or text, for an approval that
    `four_eyes` forbids, and for the library shipped with mutator, which is read-only.
    """
    made = [replace(change, by=_line(change.by, "by"), text=_line(change.text, "text")) for change in changes]
    for change in made:
        _check(change)
    path = load_review(workspace, target).path  # an error here leaves the library unchanged
    check_not_shipped(path)
    make_folder(path.parent)
    with locking_folder(path.parent):
        review = load_review(workspace, target)
        _refuse_unseen(review, made, seen)
        if review.four_eyes:
            check_four_eyes([(c.group, c.by) for c in made if c.kind is Kind.APPROVE])
        return _written(workspace, review, made)


def _check(change: Change) -> None:
    if not change.by:
        raise MutatorError("no name", argument="by", expected="the reviewer's name", remedy="give a name")
    if change.kind is Kind.REMARK and not change.text:
        raise MutatorError("no text", argument="text", expected="a remark", remedy="write a remark")


def _refuse_unseen(review: Review, changes: Sequence[Change], looked_at: Mapping[str, str]) -> None:
    groups = {change.group.id: change.group for change in changes}
    unseen = [one for one in groups.values() if review.revision(one.id) != looked_at.get(one.id, "")]
    if not unseen:
        return
    told = [f"  {one.id}  {_last_word(review, one)}" for one in unseen]
    conflict = ReviewConflict(
        "\n".join(["somebody else has changed the review in the meantime:", *told]),
        where=review.path,
        expected="no changes since you last looked",
        remedy="check again, then decide (nothing was written)",
    )
    conflict.groups, conflict.review = tuple(one.id for one in unseen), review
    raise conflict


def _last_word(review: Review, group: Group) -> str:
    remarks = review.remarks(group.id)
    flag = review.flag(group.id)
    return "; ".join(
        filter(
            None,
            (
                review.describe(group) or "no decision",
                f"flagged by {flag.by}" if flag else "",
                f"{remarks[-1].by}: {remarks[-1].text}" if remarks else "",
            ),
        )
    )


def _written(workspace: Workspace, review: Review, changes: Sequence[Change]) -> Review:
    """Store the changes. The texts that reviewers saw are written first."""
    at, commit = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}", library_commit(workspace)
    entries = dict(review.entries)
    for change in changes:
        group = change.group
        before = entries.get(group.id, Entry(group=group.id, what=group.what))
        entries[group.id] = _applied(before, change, at, commit)
    kept = {name: entry for name, entry in entries.items() if not entry.says_nothing}
    made = replace(review, entries=kept)
    for change in changes:
        if change.kind in _VERDICTS:
            seen_texts.keep(made.library, made.seen_name(change.group.id), change.group.seen)
    content = review_file.Content(entries=made.entries, four_eyes=made.four_eyes)
    write_below(made.library, _name_of(made.target), review_file.text(made.target, content).encode())
    return made


def _applied(entry: Entry, change: Change, at: str, commit: str | None) -> Entry:
    group, kind = change.group, change.kind
    if change.text:
        entry = replace(entry, remarks=(*entry.remarks, Remark(by=change.by, at=at, text=change.text)))
    if kind in _VERDICTS:
        decision = Decision(
            group=group.id,
            what=group.what,
            verdict=_VERDICTS[kind],
            by=change.by,
            at=at,
            commit=commit,
            tool=VERSION,
            bound=group.bound,
            values=group.values,
        )
        return replace(entry, what=group.what, decision=decision)
    if kind is Kind.CLEAR:
        return replace(entry, decision=None)
    if kind in (Kind.FLAG, Kind.UNFLAG):
        return replace(entry, flag=Flag(by=change.by, at=at) if kind is Kind.FLAG else None)
    return entry


def _line(text: str, argument: str) -> str:
    """Return the text as one line; MutatorError for characters that YAML cannot store."""
    line = " ".join(text.split())
    if not line.isprintable():
        raise MutatorError(
            f"{line!r}", argument=argument, expected="printable text", remedy="remove all other characters"
        )
    return line
