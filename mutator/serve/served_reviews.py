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
from mutator.review import effect_pictures, group_results, mutant_groups
from mutator.review.decisions import Review, ReviewAction, ReviewActionKind, load_review, record_actions
from mutator.review.mutant_groups import Group
from mutator.review.review_page import review_as_json, review_page_html
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

_MOST_KEPT = 8  # selections whose groups are cached
_SKIPPED = {"reviews", "__pycache__", ".git", "runs"}
Short = Annotated[str, Field(max_length=2000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """The groups on a page: all of a target, or those of some specs or of a campaign."""

    target: str
    campaign: str | None = None
    specs: tuple[str, ...] = ()

    @property
    def options(self) -> list[str]:
        if self.campaign:
            return ["--campaign", self.campaign]
        return ["--manifest", self.target, *(word for spec in self.specs for word in ("--spec", spec))]


class _ChangeModel(StrictModel):
    group: str = Field(pattern=r"^[0-9a-f]{12}$")
    kind: Annotated[ReviewActionKind, Field(strict=False)]
    text: Short = ""


class Decisions(StrictModel):
    """Changes that a page sends, with the revision and the diff's digest of each group, as the page shows it.
    Approving or rejecting a group requires the digest.
    """

    changes: Annotated[list[_ChangeModel], Field(min_length=1, max_length=5000)]
    by: Short
    seen: dict[str, Short]
    digests: dict[str, Short] = Field(default_factory=dict)


class Reviews:
    """The reviews of a library. Groups are built on first use, and again when a file changes."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._made: dict[Selection, tuple[object, tuple[Group, ...]]] = {}
        self._making = threading.Lock()

    @property
    def reviewer(self) -> str:
        return find_user_name(self.workspace.library) or ""

    def selection(self, target: str, campaign: str | None, specs: Sequence[str]) -> Selection:
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
        return Selection(target=target, campaign=campaign, specs=tuple(specs))

    def groups(self, chosen: Selection) -> tuple[Group, ...]:
        with self._making:
            stamp = self._stamp(chosen.target)
            if (made := self._made.pop(chosen, None)) is None or made[0] != stamp:
                made = stamp, self._found(chosen)
            self._made[chosen] = made
            for old in list(self._made)[:-_MOST_KEPT]:
                del self._made[old]
            return made[1]

    def group(self, chosen: Selection, name: str) -> Group:
        found = next((group for group in self.groups(chosen) if group.id == name), None)
        if found is None:
            raise NotServed(f"no group '{name}'", expected="the id of a group on the page")
        return found

    def page(self, chosen: Selection, query: str, runs: Sequence[Mapping[str, Any]], token: str) -> str:
        review, groups = load_review(self.workspace, chosen.target), self.groups(chosen)
        served = {
            "target": chosen.target,
            "by": self.reviewer,
            "api": f"/api/review/{chosen.target}",
            "token": token,
            "query": f"?{query}" if query else "",
            "runs": runs,
        }
        return review_page_html(review, review.in_list_order(groups), chosen.options, served)

    def told(self, chosen: Selection) -> dict[str, Any]:
        groups = self.groups(chosen)  # first, because this can take seconds, and others can decide meanwhile
        review = load_review(self.workspace, chosen.target)
        return {"target": chosen.target, "by": self.reviewer, "groups": _states(review, groups)}

    def decide(self, chosen: Selection, wanted: Decisions) -> dict[str, Any]:
        """Save all changes or none; GroupsChanged if a group or a diff was changed elsewhere."""
        known = {group.id: group for group in self.groups(chosen)}
        if strangers := [one.group for one in wanted.changes if one.group not in known]:
            raise NotServed(f"no group '{strangers[0]}'", expected="the id of a group on the page")
        if unseen := [one.group for one in wanted.changes if one.group not in wanted.seen]:
            raise MutatorError(f"no revision of group {unseen[0]}", where="seen")
        decided = [
            one.group
            for one in wanted.changes
            if one.kind in (ReviewActionKind.APPROVE, ReviewActionKind.REJECT)
        ]
        if blind := [name for name in decided if name not in wanted.digests]:
            raise MutatorError(f"no digest of the diff of group {blind[0]}", where="digests")
        touched = [known[name] for name in dict.fromkeys(one.group for one in wanted.changes)]
        self._refuse_others(chosen, touched, wanted.digests)
        changes = [
            ReviewAction(group=known[one.group], kind=one.kind, by=wanted.by, text=one.text)
            for one in wanted.changes
        ]
        try:
            review = record_actions(self.workspace, chosen.target, changes, wanted.seen)
        except ReviewConflict as conflict:
            others = [known[name] for name in conflict.groups]
            raise GroupsChanged(conflict.got, _states(conflict.review, others)) from None
        return {"target": chosen.target, "by": self.reviewer, "groups": _states(review, touched)}

    def changes(self, chosen: Selection, name: str) -> str:
        return load_review(self.workspace, chosen.target).diff_since_decision(self.group(chosen, name))

    def picture(self, chosen: Selection, name: str, level: str, *, after: bool) -> bytes:
        """Return a frame before or after the group's effect, as a JPEG file; Absent if there is none."""
        manifest = self.workspace.manifest(chosen.target)
        found = effect_pictures.pictures_at_level(self.workspace, manifest, self.group(chosen, name), level)
        if found is None:
            raise NotServed(
                "no such picture",
                expected=f"one of the group's levels ({', '.join(effect_pictures.LEVEL_NAMES)})",
            )
        return found[after]

    def levels(self, chosen: Selection, name: str) -> list[dict[str, str]]:
        """Return the levels that have frames, with their values as text."""
        manifest, group = self.workspace.manifest(chosen.target), self.group(chosen, name)
        found = effect_pictures.pictures_of_groups(self.workspace, manifest, [group]).get(name)
        return [{"name": level.name, "label": level.label} for level in found.levels] if found else []

    def typical(self, chosen: Selection, name: str, run: Path) -> dict[str, Any] | None:
        """Return the group's results in a run; None if the run does not have the group."""
        folder, group = RunFolder.open(run), self.group(chosen, name)
        found = group_results.results_of_group(folder, group) if folder.head.target == chosen.target else None
        return asdict(found) if found else None

    def _refuse_others(self, chosen: Selection, groups: Sequence[Group], digests: Mapping[str, str]) -> None:
        now = _states(load_review(self.workspace, chosen.target), groups)
        other = {
            name: facts
            for name, facts in now.items()
            if digests.get(name, facts["digest"]) != facts["digest"]
        }
        if other:
            names = ", ".join(other)
            raise GroupsChanged(f"the diff has changed in {names}; reload the page", other)

    def _found(self, chosen: Selection) -> tuple[Group, ...]:
        workspace = self.workspace
        if chosen.campaign is None:
            return mutant_groups.groups_of_library(
                workspace, workspace.manifest(chosen.target), specs=chosen.specs
            )
        plan = build_plan(workspace, chosen.campaign, Choices())
        if plan.campaign.target != chosen.target:
            raise NotServed(f"campaign '{chosen.campaign}' belongs to target '{plan.campaign.target}'")
        return mutant_groups.groups_of_plan(workspace, plan)

    def _stamp(self, target: str) -> object:
        manifest = self.workspace.manifest(target)
        places = (self.workspace.library, self.workspace.templates, manifest.root)
        return [_files_in(place) for place in places]


def _states(review: Review, groups: Iterable[Group]) -> dict[str, Any]:
    return {group.id: review_as_json(review, group) for group in groups}


def _files_in(place: Path) -> list[tuple[str, int, int]]:
    found = []
    for folder, inner, names in os.walk(place):
        inner[:] = sorted({*inner} - _SKIPPED)
        for name in names:
            path = os.path.join(folder, name)  # noqa: PTH118 - for speed
            with suppress(OSError):  # the file has been deleted in the meantime
                facts = os.lstat(path)
                found.append((path, facts.st_mtime_ns, facts.st_size))
    return found
