"""Reviews on the server: the current groups of a target, and decisions, which are saved immediately."""

import os
import threading
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from mutator.campaigns.git_clone import find_user_name
from mutator.campaigns.plan import build_plan
from mutator.config.yaml_files import StrictModel
from mutator.errors import GroupsChanged, MutatorError, NotServed, ReviewConflict
from mutator.review import group_results, image_effect_pictures, mutant_groups
from mutator.review.mutant_groups import Group
from mutator.review.review_page import group_review_as_json, review_page_html
from mutator.review.review_state_and_actions import (
    Review,
    ReviewAction,
    ReviewActionKind,
    load_review,
    record_actions,
)
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

_MOST_CACHED_SELECTIONS = 8  # selections whose groups are cached
_SKIPPED_FOLDERS = {"reviews", "__pycache__", ".git", "runs"}
ShortText = Annotated[str, Field(max_length=2000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupSelection:
    """The groups on a page: all of a target, or those of some specs or of a campaign."""

    target: str
    campaign: str | None = None
    specs: tuple[str, ...] = ()

    @property
    def cli_options(self) -> list[str]:
        if self.campaign:
            return ["--campaign", self.campaign]
        return ["--manifest", self.target, *(word for spec in self.specs for word in ("--spec", spec))]


class _DecisionModel(StrictModel):
    group: str = Field(pattern=r"^[0-9a-f]{12}$")
    kind: Annotated[ReviewActionKind, Field(strict=False)]
    text: ShortText = ""

    def action_on(self, group: Group, by: str) -> ReviewAction:
        """Return the action; the text of a rejection is its reason, that of all others a remark."""
        is_rejection = self.kind is ReviewActionKind.REJECT
        words = {"reason" if is_rejection else "text": self.text}
        return ReviewAction(group=group, kind=self.kind, by=by, **words)


class SentDecisions(StrictModel):
    """Changes that a page sends, with the revision and the diff's digest of each group, as the page shows it.
    Approving or rejecting a group requires the digest.
    """

    changes: Annotated[list[_DecisionModel], Field(min_length=1, max_length=5000)]
    by: ShortText
    seen: dict[str, ShortText]
    digests: dict[str, ShortText] = Field(default_factory=dict)


class ServedReviews:
    """The reviews of a library. Groups are built on first use, and again when a file changes."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._cached_groups: dict[GroupSelection, tuple[object, tuple[Group, ...]]] = {}
        self._groups_lock = threading.Lock()

    @property
    def reviewer(self) -> str:
        return find_user_name(self.workspace.library) or ""

    def checked_selection(self, target: str, campaign: str | None, specs: Sequence[str]) -> GroupSelection:
        if target not in self.workspace.targets:
            raise NotServed(f"no target '{target}'", expected=f"one of {', '.join(self.workspace.targets)}")
        if campaign is not None and campaign not in self.workspace.campaigns:
            raise NotServed(
                f"no campaign '{campaign}'", expected=f"one of {', '.join(self.workspace.campaigns)}"
            )
        if campaign and specs:
            raise MutatorError("a campaign together with specs", expected="one or the other")
        for spec in specs:
            if spec.endswith((".yaml", ".yml")):
                raise NotServed(
                    f"no spec '{spec}'", expected="the name of a spec in the library, or a pattern"
                )
        return GroupSelection(target=target, campaign=campaign, specs=tuple(specs))

    def groups(self, selection: GroupSelection) -> tuple[Group, ...]:
        with self._groups_lock:
            stamp = self._input_file_stamps(selection.target)
            if (cached := self._cached_groups.pop(selection, None)) is None or cached[0] != stamp:
                cached = stamp, self._build_groups(selection)
            self._cached_groups[selection] = cached
            for old in list(self._cached_groups)[:-_MOST_CACHED_SELECTIONS]:
                del self._cached_groups[old]
            return cached[1]

    def group(self, selection: GroupSelection, name: str) -> Group:
        matching = next((group for group in self.groups(selection) if group.id == name), None)
        if matching is None:
            raise NotServed(f"no group '{name}'", expected="the id of a group on the page")
        return matching

    def render_html_page(
        self, selection: GroupSelection, query: str, runs: Sequence[Mapping[str, Any]], token: str
    ) -> str:
        review, groups = load_review(self.workspace, selection.target), self.groups(selection)
        page_settings = {
            "target": selection.target,
            "by": self.reviewer,
            "api": f"/api/review/{selection.target}",
            "token": token,
            "query": f"?{query}" if query else "",
            "runs": runs,
        }
        return review_page_html(review, review.in_list_order(groups), selection.cli_options, page_settings)

    def group_reviews(self, selection: GroupSelection) -> dict[str, Any]:
        groups = self.groups(
            selection
        )  # first, because this can take seconds, and others can decide meanwhile
        review = load_review(self.workspace, selection.target)
        return {
            "target": selection.target,
            "by": self.reviewer,
            "groups": _review_json_by_group(review, groups),
        }

    def decide(self, selection: GroupSelection, decisions: SentDecisions) -> dict[str, Any]:
        """Save all changes or none; GroupsChanged if a group or a diff was changed elsewhere."""
        group_by_id = {group.id: group for group in self.groups(selection)}
        if unknown_groups := [
            change.group for change in decisions.changes if change.group not in group_by_id
        ]:
            raise NotServed(f"no group '{unknown_groups[0]}'", expected="the id of a group on the page")
        if without_revision := [
            change.group for change in decisions.changes if change.group not in decisions.seen
        ]:
            raise MutatorError(f"no revision of group {without_revision[0]}", where="seen")
        decided = [
            change.group
            for change in decisions.changes
            if change.kind in (ReviewActionKind.APPROVE, ReviewActionKind.REJECT)
        ]
        if without_digest := [name for name in decided if name not in decisions.digests]:
            raise MutatorError(f"no digest of the diff of group {without_digest[0]}", where="digests")
        changed_groups = [
            group_by_id[name] for name in dict.fromkeys(change.group for change in decisions.changes)
        ]
        self._check_diffs_unchanged(selection, changed_groups, decisions.digests)
        changes = [change.action_on(group_by_id[change.group], decisions.by) for change in decisions.changes]
        try:
            review = record_actions(self.workspace, selection.target, changes, decisions.seen)
        except ReviewConflict as conflict:
            others = [group_by_id[name] for name in conflict.groups]
            raise GroupsChanged(conflict.got, _review_json_by_group(conflict.review, others)) from None
        return {
            "target": selection.target,
            "by": self.reviewer,
            "groups": _review_json_by_group(review, changed_groups),
        }

    def diff_since_decision(self, selection: GroupSelection, name: str) -> str:
        return load_review(self.workspace, selection.target).diff_since_decision(self.group(selection, name))

    def picture(self, selection: GroupSelection, name: str, level: str, *, after: bool) -> bytes:
        """Return a frame before or after the group's effect, as a JPEG file; NotServed if there is none."""
        manifest = self.workspace.manifest(selection.target)
        before_and_after = image_effect_pictures.jpegs_before_and_after(
            self.workspace, manifest, self.group(selection, name), level
        )
        if before_and_after is None:
            raise NotServed(
                "no such picture",
                expected=f"one of the group's levels ({', '.join(image_effect_pictures.LEVEL_NAMES)})",
            )
        return before_and_after[after]

    def picture_levels(self, selection: GroupSelection, name: str) -> list[dict[str, str]]:
        """Return the levels that have frames, with their values as text."""
        manifest, group = self.workspace.manifest(selection.target), self.group(selection, name)
        pictures_of_group = image_effect_pictures.pictures_of_groups(self.workspace, manifest, [group]).get(
            name
        )
        return (
            [{"name": level.name, "label": level.label} for level in pictures_of_group.levels]
            if pictures_of_group
            else []
        )

    def typical_results(self, selection: GroupSelection, name: str, run: Path) -> dict[str, Any] | None:
        """Return the group's results in a run; None if the run does not have the group."""
        folder, group = RunFolder.open(run), self.group(selection, name)
        if folder.head.target != selection.target:
            return None
        results = group_results.results_of_group(folder, group)
        return asdict(results) if results else None

    def _check_diffs_unchanged(
        self, selection: GroupSelection, groups: Sequence[Group], digests: Mapping[str, str]
    ) -> None:
        current_states = _review_json_by_group(load_review(self.workspace, selection.target), groups)
        changed_states = {
            name: facts
            for name, facts in current_states.items()
            if digests.get(name, facts["digest"]) != facts["digest"]
        }
        if changed_states:
            names = ", ".join(changed_states)
            raise GroupsChanged(f"the diff has changed in {names}; reload the page", changed_states)

    def _build_groups(self, selection: GroupSelection) -> tuple[Group, ...]:
        workspace = self.workspace
        if selection.campaign is None:
            return mutant_groups.groups_of_library(
                workspace, workspace.manifest(selection.target), specs=selection.specs
            )
        plan = build_plan(workspace, selection.campaign, Choices())
        if plan.campaign.target != selection.target:
            raise NotServed(f"campaign '{selection.campaign}' belongs to target '{plan.campaign.target}'")
        return mutant_groups.groups_of_plan(workspace, plan)

    def _input_file_stamps(self, target: str) -> object:
        manifest = self.workspace.manifest(target)
        places = (self.workspace.library, self.workspace.templates, manifest.root)
        return [_file_stamps_in(place) for place in places]


def _review_json_by_group(review: Review, groups: Iterable[Group]) -> dict[str, Any]:
    return {group.id: group_review_as_json(review, group) for group in groups}


def _file_stamps_in(root: Path) -> list[tuple[str, int, int]]:
    files = []
    for folder, subfolders, names in os.walk(root):
        subfolders[:] = sorted({*subfolders} - _SKIPPED_FOLDERS)
        for name in names:
            path = os.path.join(folder, name)  # noqa: PTH118 - for speed
            with suppress(OSError):  # the file has been deleted in the meantime
                facts = os.lstat(path)
                files.append((path, facts.st_mtime_ns, facts.st_size))
    return files
