"""Groups of mutants that differ only in values, and the reviewers' decisions about them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import make_folder, write_atomic
from mutator.api.target_and_fault_selection import WorkspaceLike, open_workspace
from mutator.campaigns.git_clone import find_user_name
from mutator.campaigns.plan import build_plan
from mutator.campaigns.row_filters import matching_items
from mutator.errors import MutatorError
from mutator.review import mutant_groups
from mutator.review.approval_gate import describe_experiment_count, unapproved_reason
from mutator.review.group_filter_columns import GROUP_FILTER_COLUMNS
from mutator.review.image_effect_pictures import pictures_of_groups
from mutator.review.mutant_groups import Group
from mutator.review.review_page import write_review_page
from mutator.review.review_state_and_actions import (
    Review,
    ReviewAction,
    ReviewActionKind,
    ReviewState,
    record_actions,
)
from mutator.review.review_state_and_actions import load_review as load_decisions
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace

PictureFiles = dict[str, dict[str, str]]  # by group: the file of each picture, by name


@dataclass(frozen=True, kw_only=True)
class ReviewedGroups:
    """Groups of mutants, new and changed ones first, and the decisions about them."""

    workspace: Workspace  #: the workspace whose review file holds the decisions
    review: Review  #: the decisions
    groups: tuple[Group, ...]  #: groups of mutants that differ only in values; new and changed ones first
    options: tuple[str, ...] = ()  #: options of `mutator review` that select the same groups

    @property
    def undecided(self) -> tuple[Group, ...]:
        """The groups that are new or have changed since their decision."""
        return tuple(g for g in self.groups if self.review.state(g) in (ReviewState.NEW, ReviewState.CHANGED))

    @property
    def lacking(self) -> tuple[tuple[Group, str], ...]:
        """The groups that `run --require-reviewed` refuses, and why, e.g. `missing, 12 experiments`."""
        return tuple(
            (
                group,
                f"{unapproved_reason(self.review, group)}, {describe_experiment_count(group)}",
            )
            for group in self.review.in_list_order(self.groups)
            if self.review.state(group) is not ReviewState.APPROVED
        )

    def reread(self) -> "ReviewedGroups":
        """Return the same groups with the decisions that are currently stored."""
        return replace(self, review=load_decisions(self.workspace, self.review.target))

    def matching(self, only: str | None = None, exclude: str | None = None) -> "ReviewedGroups":
        """Return the groups that match the filters, which are expressions over `group_facts`."""
        groups = self.groups
        for text, keeps_matches in ((only, True), (exclude, False)):
            if text is not None:
                groups = tuple(
                    matching_items(
                        groups,
                        text,
                        GROUP_FILTER_COLUMNS,
                        lambda group: group_facts(self.review, group),
                        keeps_matches=keeps_matches,
                    )
                )
        return replace(self, groups=groups)

    def find(self, starts: Sequence[str]) -> list[Group]:
        """Return the groups whose ids start with `starts`; MutatorError unless each start fits exactly
        one.
        """
        group_by_id: dict[str, Group] = {}
        for start in starts:
            matches = [group for group in self.groups if group.id.startswith(start)]
            if len(matches) != 1 or not start:  # every id starts with an empty text
                raise MutatorError(
                    f"several ids ({len(matches)}) start with '{start}'"
                    if matches
                    else f"no group '{start}'",
                    expected="an id from `mutator review`, or the start of only one id",
                    remedy="give more digits of the id" if matches else "select the group's campaign or spec",
                )
            group_by_id[matches[0].id] = matches[0]
        return list(group_by_id.values())

    def approve(self, groups: Sequence[Group], by: str, remark: str = "") -> "ReviewedGroups":
        """Approve groups in their current state, and write the decision into the library."""
        return self._record_actions(groups, ReviewActionKind.APPROVE, by, remark)

    def reject(
        self, groups: Sequence[Group], by: str, remark: str = "", reason: str = ""
    ) -> "ReviewedGroups":
        """Reject groups in their current state, and write the decision and its `reason` into the library."""
        return self._record_actions(groups, ReviewActionKind.REJECT, by, remark, reason)

    def clear(self, groups: Sequence[Group], by: str, remark: str = "") -> "ReviewedGroups":
        """Withdraw the decisions about groups; remarks and flags stay."""
        return self._record_actions(groups, ReviewActionKind.CLEAR, by, remark)

    def remark(self, groups: Sequence[Group], by: str, text: str) -> "ReviewedGroups":
        """Add a remark to groups."""
        return self._record_actions(groups, ReviewActionKind.REMARK, by, text)

    def flag(self, groups: Sequence[Group], by: str) -> "ReviewedGroups":
        """Flag groups for another look."""
        return self._record_actions(groups, ReviewActionKind.FLAG, by)

    def unflag(self, groups: Sequence[Group], by: str) -> "ReviewedGroups":
        """Remove flags."""
        return self._record_actions(groups, ReviewActionKind.UNFLAG, by)

    def write_page(self, out: str | Path) -> Path:
        """Write all groups to one self-contained HTML page."""
        write_review_page(Path(out), self.review, self.groups, self.options)
        return Path(out)

    def _record_actions(
        self, groups: Sequence[Group], kind: ReviewActionKind, by: str, text: str = "", reason: str = ""
    ) -> "ReviewedGroups":
        actions = [ReviewAction(group=group, kind=kind, by=by, text=text, reason=reason) for group in groups]
        # a decision that somebody else has stored since is not overwritten
        revision_by_group = {group.id: self.review.revision(group.id) for group in groups}
        return replace(
            self, review=record_actions(self.workspace, self.review.target, actions, revision_by_group)
        )


def load_review(
    *,
    campaign: str | None = None,
    specs: Sequence[str] = (),
    reading: str | None = None,
    seed: int | None = None,
    target: str | None = None,
    workspace: WorkspaceLike = None,
) -> ReviewedGroups:
    """Load the groups of mutants of a campaign, of specs (names, globs, files), or of the whole library.

    Every mutant is built, none is run. `target` names a manifest; default: the library's only one, or the
    campaign's. MutatorError for a campaign together with specs, and for mistakes in them.
    """
    if campaign and specs:
        raise MutatorError("given together with specs", argument="campaign", expected="one or the other")
    opened_workspace = open_workspace(workspace)
    if campaign:
        plan = build_plan(opened_workspace, campaign, Choices(seed=seed, reading=reading))
        manifest = opened_workspace.manifest(plan.campaign.target)
        groups = mutant_groups.groups_of_plan(opened_workspace, plan)
    else:
        manifest = opened_workspace.manifest(opened_workspace.target_name(target))
        groups = mutant_groups.groups_of_library(
            opened_workspace, manifest, specs=specs, reading=reading, seed=seed or 0
        )
    review = load_decisions(opened_workspace, manifest.name)
    value_by_option = {"--campaign": campaign, "--reading": reading, "--manifest": target}
    options = [word for name, value in value_by_option.items() if value for word in (name, value)]
    options += ["--seed", str(seed)] if seed is not None else []  # 0 is a seed
    options += [word for spec in specs for word in ("--spec", spec)]
    return ReviewedGroups(
        workspace=opened_workspace,
        review=review,
        groups=tuple(review.in_list_order(groups)),
        options=tuple(options),
    )


def group_facts(review: Review, group: Group) -> dict[str, object]:
    """Return the columns that filters can use for a group. Commas separate several values."""
    decision = review.decision(group.id)
    return {
        "group": group.id,
        "state": review.state(group).value,
        "by": decision.by if decision else None,
        "reason": decision.reason if decision else None,
        "flagged": review.flag(group.id) is not None,
        "file": ", ".join(group.files),
        "function": ", ".join(group.functions),
        "model": ", ".join(group.models),
        "trigger": group.trigger_kinds,
        "hold": group.hold_kinds,
        "spec": ", ".join(group.specs),
        "faults": len(group.faults),
        "runs": group.experiment_count,
    }


def reviewer_name(workspace: WorkspaceLike = None) -> str | None:
    """Return `user.name` of the user's own git configuration; None if it is not set."""
    return find_user_name(open_workspace(workspace).library)


def write_pictures(
    groups: Sequence[Group], target: str, folder: Path, *, workspace: WorkspaceLike = None
) -> tuple[PictureFiles, dict[str, str]]:
    """Write `<group>-before.jpg` and one frame for each level, for each group that is an image effect. Return
    the files by group, and the value that each file shows.
    """
    opened_workspace = open_workspace(workspace)
    pictures_by_group = pictures_of_groups(opened_workspace, opened_workspace.manifest(target), groups)
    files_by_group: PictureFiles = {}
    value_by_file: dict[str, str] = {}
    if pictures_by_group:
        make_folder(folder)  # only if there is a picture to put into it
    for name, pictures in pictures_by_group.items():
        picture_by_level = {"before": ("", pictures.before_jpeg)}
        picture_by_level |= {level.name: (level.label, level.after_jpeg) for level in pictures.levels}
        for level, (value, picture) in picture_by_level.items():
            path = path_below(folder, f"{name}-{level}.jpg")
            write_atomic(path, picture)
            files_by_group.setdefault(name, {})[level] = str(path)
            value_by_file[str(path)] = value
    return files_by_group, value_by_file
