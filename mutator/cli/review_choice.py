"""Which groups of mutants are meant: of a campaign, of specs, of all the library; by filter, by id."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mutator.cli.console import Terminal
from mutator.cli.options import Place
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.review.catalogue import Group
    from mutator.review.decisions import Review

COLUMNS = ("group", "state", "by", "file", "function", "model", "trigger", "hold", "spec", "faults", "runs")


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is to be reviewed: a campaign, specs, or all of the library."""

    place: Place
    campaign: str | None
    specs: Sequence[str]
    reading: str | None
    seed: int | None
    manifest: str | None

    def load(self, terminal: Terminal) -> "Loaded":
        """Its groups and what was said of them."""
        from mutator.review import catalogue
        from mutator.review.decisions import load_review

        if self.campaign and self.specs:
            raise MutatorError("--campaign together with --spec", expected="one or the other")
        workspace = self.place.workspace()
        with terminal.wait("making the mutants"):
            if self.campaign:
                from mutator.campaigns.plans import Choices, make_plan

                plan = make_plan(workspace, self.campaign, Choices(seed=self.seed, reading=self.reading))
                target = plan.campaign.target
                groups = catalogue.of_plan(workspace, plan)
            else:
                target = workspace.target_name(self.manifest)
                groups = catalogue.of_library(
                    workspace,
                    workspace.manifest(target),
                    specs=self.specs,
                    reading=self.reading,
                    seed=self.seed or 0,
                )
        manifest = workspace.manifest(target)
        found = load_review(workspace, manifest.name)
        return Loaded(review=found, groups=tuple(found.in_turn(groups)), options=self.options)

    @property
    def options(self) -> tuple[str, ...]:
        """The options that mean the same again, for a command that is printed."""
        given = {"--campaign": self.campaign, "--reading": self.reading, "--manifest": self.manifest}
        words = [word for name, value in given.items() if value for word in (name, value)]
        seed = ("--seed", str(self.seed)) if self.seed is not None else ()
        return (*words, *seed, *(word for spec in self.specs for word in ("--spec", spec)))


@dataclass(frozen=True, kw_only=True)
class Loaded:
    """Groups in the order in which they are listed, and the decisions about them."""

    review: "Review"
    groups: tuple["Group", ...]
    options: tuple[str, ...]

    def matching(self, only: str | None, exclude: str | None) -> "Loaded":
        """Those for which the filters hold."""
        from mutator.campaigns.filters import compile_filter

        groups = self.groups
        for text, wanted in ((only, True), (exclude, False)):
            if text is not None:
                accepts = compile_filter(text, COLUMNS)
                groups = tuple(g for g in groups if accepts(columns(self.review, g)) is wanted)
        return replace(self, groups=groups)

    def find(self, starts: Sequence[str]) -> list["Group"]:
        """The groups whose ids start so, each once; MutatorError for none or several of a start."""
        found: dict[str, Group] = {}
        for start in starts:
            hits = [group for group in self.groups if group.id.startswith(start)]
            if len(hits) != 1 or not start:
                raise MutatorError(
                    f"{len(hits)} groups start with '{start}'" if hits else f"no group '{start}'",
                    expected="an id of `mutator review`, or the beginning of just one",
                    remedy="give more of it" if hits else "name the --campaign or --spec that it is of",
                )
            found[hits[0].id] = hits[0]
        return list(found.values())


def columns(review: "Review", group: "Group") -> dict[str, object]:
    """What the filters know of a group; several of one kind stand with commas between them."""
    decision = review.decisions.get(group.id)
    return {
        "group": group.id,
        "state": review.state(group).value,
        "by": decision.by if decision else None,
        "file": ", ".join(group.files),
        "function": ", ".join(group.functions),
        "model": ", ".join(group.models),
        "trigger": group.trigger,
        "hold": group.hold,
        "spec": ", ".join(group.specs),
        "faults": len(group.faults),
        "runs": group.runs,
    }
