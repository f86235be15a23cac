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
from mutator.review import review_file, reviewed_texts
from mutator.review.commits_and_four_eyes import check_four_eyes, library_commit
from mutator.review.mutant_groups import Group
from mutator.review.review_entries import DecisionVerdict, Flag, GroupDecision, Remark, ReviewEntry
from mutator.workspace import Workspace

_REVIEWS_FOLDER = "reviews"  # in the library


class ReviewState(StrEnum):
    """The state of a group's review, in list order."""

    NEW = "new"  # no decision
    CHANGED = "changed"  # since the decision
    REJECTED = "rejected"
    APPROVED = "approved"


class ReviewActionKind(StrEnum):
    """An action of a reviewer on a group."""

    APPROVE = "approve"
    REJECT = "reject"
    CLEAR = "clear"  # withdraw the decision
    REMARK = "remark"
    FLAG = "flag"
    UNFLAG = "unflag"


_VERDICT_BY_ACTION = {
    ReviewActionKind.APPROVE: DecisionVerdict.APPROVED,
    ReviewActionKind.REJECT: DecisionVerdict.REJECTED,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReviewAction:
    """An action of the reviewer `by` on a group in its current state. `text` is stored as a remark,
    `reason` with a rejection.
    """

    group: Group
    kind: ReviewActionKind
    by: str
    text: str = ""
    reason: str = ""


@dataclass(frozen=True, kw_only=True)
class Review:
    """The reviews of one target's groups, by group, in a library.

    With `four_eyes`, the author of a group's last change cannot approve it.
    """

    library: Path
    target: str
    entry_by_group: Mapping[str, ReviewEntry]
    four_eyes: bool = False

    @property
    def path(self) -> Path:
        """The file, which might not exist."""
        return path_below(self.library, _review_file_name(self.target))

    def decision(self, group_id: str) -> GroupDecision | None:
        entry = self.entry_by_group.get(group_id)
        return entry.decision if entry else None

    def remarks(self, group_id: str) -> tuple[Remark, ...]:
        """Return the group's remarks, oldest first."""
        entry = self.entry_by_group.get(group_id)
        return entry.remarks if entry else ()

    def flag(self, group_id: str) -> Flag | None:
        entry = self.entry_by_group.get(group_id)
        return entry.flag if entry else None

    def revision(self, group_id: str) -> str:
        """Digest of the group's review; empty if there is none."""
        entry = self.entry_by_group.get(group_id)
        return entry.revision if entry else ""

    def stale_parts(self, group: Group) -> list[str]:
        """Return the parts of a group that changed since the decision, as text."""
        decision = self.decision(group.id)
        return decision.changed_parts(group.basis_digests, group.value_ranges) if decision else []

    def state(self, group: Group) -> ReviewState:
        decision = self.decision(group.id)
        if decision is None:
            return ReviewState.NEW
        return ReviewState.CHANGED if self.stale_parts(group) else ReviewState(decision.verdict.value)

    def diff_since_decision(self, group: Group) -> str:
        """Return a unified diff from what the reviewer saw to the current state; empty if the decision is
        valid, or if what the reviewer saw was not stored.
        """
        decision = self.decision(group.id)
        if decision is None or not self.stale_parts(group):
            return ""
        return reviewed_texts.diff_from_reviewed_text(
            self.library, self.path_of_reviewed_text(group.id), decision.bound, group.reviewed_text
        )

    def path_of_reviewed_text(self, group_id: str) -> str:
        """Return the file in the library with the text of a group that the reviewer saw."""
        return f"{_REVIEWS_FOLDER}/seen/{self.target}/{group_id}.txt"

    def in_list_order(self, groups: Iterable[Group]) -> list[Group]:
        """Return the groups in list order: new and changed ones first."""
        order = list(ReviewState)
        return sorted(groups, key=lambda group: order.index(self.state(group)))

    def describe_decision(self, group: Group) -> str:
        """Return the decision about the group and what changed since, as text; empty without a decision."""
        decision = self.decision(group.id)
        if decision is None:
            return ""
        changed = self.stale_parts(group)
        since = f" (changed since: {', '.join(changed)})" if changed else ""
        older = "" if decision.bound.calls else " (made before called code and values were stored)"
        return decision.summary + since + older


def load_review(workspace: Workspace, target: str) -> Review:
    """Load the reviews of a target's groups; empty if there is no file. MutatorError, with the line, for a
    mistake. Links are refused: errors would reveal the linked file, and a change would replace the link.
    """
    library, name = workspace.library, _review_file_name(target)
    try:
        open_below(library, name).close()
    except FileNotFoundError:
        return Review(library=library, target=target, entry_by_group={})
    content = review_file.load_review_file(path_below(library, name), target)
    return Review(
        library=library, target=target, entry_by_group=content.entry_by_group, four_eyes=content.four_eyes
    )


def _review_file_name(target: str) -> str:
    """Return the file of a target's reviews in the library."""
    return f"{_REVIEWS_FOLDER}/{target}.yaml"


def record_actions(
    workspace: Workspace, target: str, requested: Sequence[ReviewAction], revision_by_group: Mapping[str, str]
) -> Review:
    """Apply all actions or none, and return the stored review.

    `revision_by_group` has the revisions that the caller saw (`Review.revision`; missing groups had no
    review). A lock serializes callers across processes. ReviewConflict if somebody else has changed the
    review of one of the groups since; MutatorError for an unusable name or text, for an approval that
    `four_eyes` forbids, and for the library shipped with mutator, which is read-only.
    """
    actions = [
        replace(
            change,
            by=_printable_line(change.by, "by"),
            text=_printable_line(change.text, "text"),
            reason=_printable_line(change.reason, "reason"),
        )
        for change in requested
    ]
    for change in actions:
        _check_action(change)
    path = load_review(workspace, target).path  # an error here leaves the library unchanged
    check_not_shipped(path)
    make_folder(path.parent)
    with locking_folder(path.parent):
        review = load_review(workspace, target)
        _check_revisions(review, actions, revision_by_group)
        if review.four_eyes:
            check_four_eyes([(c.group, c.by) for c in actions if c.kind is ReviewActionKind.APPROVE])
        return _store_actions(workspace, review, actions)


def _check_action(action: ReviewAction) -> None:
    if not action.by:
        raise MutatorError("no name", argument="by", expected="the reviewer's name", remedy="give a name")
    if action.kind is ReviewActionKind.REMARK and not action.text:
        raise MutatorError("no text", argument="text", expected="a remark", remedy="write a remark")


def _check_revisions(
    review: Review, actions: Sequence[ReviewAction], revision_by_group: Mapping[str, str]
) -> None:
    groups = {change.group.id: change.group for change in actions}
    unseen = [
        group for group in groups.values() if review.revision(group.id) != revision_by_group.get(group.id, "")
    ]
    if not unseen:
        return
    descriptions = [f"  {group.id}  {_describe_entry(review, group)}" for group in unseen]
    conflict = ReviewConflict(
        "\n".join(["somebody else has changed the review in the meantime:", *descriptions]),
        where=review.path,
        expected="no changes since you last looked",
        remedy="check again, then decide (nothing was written)",
    )
    conflict.groups, conflict.review = tuple(stale_group.id for stale_group in unseen), review
    raise conflict


def _describe_entry(review: Review, group: Group) -> str:
    remarks = review.remarks(group.id)
    flag = review.flag(group.id)
    return "; ".join(
        filter(
            None,
            (
                review.describe_decision(group) or "no decision",
                f"flagged by {flag.by}" if flag else "",
                f"{remarks[-1].by}: {remarks[-1].text}" if remarks else "",
            ),
        )
    )


def _store_actions(workspace: Workspace, review: Review, actions: Sequence[ReviewAction]) -> Review:
    """Store the changes. The texts that reviewers saw are written first."""
    at, commit = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}", library_commit(workspace)
    entries = dict(review.entry_by_group)
    for action in actions:
        group = action.group
        before = entries.get(group.id, ReviewEntry(group=group.id, what=group.label))
        entries[group.id] = _entry_after_action(before, action, at, commit)
    nonempty_entries = {name: entry for name, entry in entries.items() if not entry.is_empty}
    updated = replace(review, entry_by_group=nonempty_entries)
    for action in actions:
        if action.kind in _VERDICT_BY_ACTION:
            reviewed_texts.write_reviewed_text(
                updated.library, updated.path_of_reviewed_text(action.group.id), action.group.reviewed_text
            )
    content = review_file.ReviewFileContent(
        entry_by_group=updated.entry_by_group, four_eyes=updated.four_eyes
    )
    write_below(
        updated.library,
        _review_file_name(updated.target),
        review_file.render_review_file(updated.target, content).encode(),
    )
    return updated


def _entry_after_action(entry: ReviewEntry, action: ReviewAction, at: str, commit: str | None) -> ReviewEntry:
    group, kind = action.group, action.kind
    if action.text:
        entry = replace(entry, remarks=(*entry.remarks, Remark(by=action.by, at=at, text=action.text)))
    if kind in _VERDICT_BY_ACTION:
        decision = GroupDecision(
            group=group.id,
            what=group.label,
            verdict=_VERDICT_BY_ACTION[kind],
            by=action.by,
            at=at,
            commit=commit,
            tool=VERSION,
            reason=action.reason or None,
            bound=group.basis_digests,
            values=group.value_ranges,
        )
        return replace(entry, what=group.label, decision=decision)
    if kind is ReviewActionKind.CLEAR:
        return replace(entry, decision=None)
    if kind in (ReviewActionKind.FLAG, ReviewActionKind.UNFLAG):
        return replace(entry, flag=Flag(by=action.by, at=at) if kind is ReviewActionKind.FLAG else None)
    return entry


def _printable_line(text: str, argument: str) -> str:
    """Return the text as one line; MutatorError for characters that YAML cannot store."""
    line = " ".join(text.split())
    if not line.isprintable():
        raise MutatorError(
            f"{line!r}", argument=argument, expected="printable text", remedy="remove all other characters"
        )
    return line
