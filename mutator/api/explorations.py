"""Explorations: how large and how long a fault may be before a hazard follows."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar, cast, overload

from mutator._common.argument_checks import check_number, check_whole_number
from mutator._common.message_text import describe_choices
from mutator.api.benches import bench_values, distributor_of_cluster, warn_of_end
from mutator.api.exploration_benches import (
    SEARCHED_DURATIONS,
    SEARCHED_MAGNITUDES,
    explore_envelopes,
    opened_exploration,
    search_findings,
    within_budget,
)
from mutator.api.exploration_planes import chosen_planes
from mutator.api.run_envelopes import RunEnvelope, envelopes_of_replay
from mutator.api.scenario_choice import ScenarioLike
from mutator.api.target_and_fault_selection import (
    TriggerLike,
    WorkspaceLike,
    open_workspace,
)
from mutator.campaigns.exploration_section import (
    CHALLENGER_KINDS,
    DEFAULT_OBSERVE_S,
    STRATEGIES,
    ExplorationSection,
    ExploredPlane,
)
from mutator.errors import MutatorError
from mutator.execution.session_summary import Summary
from mutator.explore.finding_search import Finding, dominated_share
from mutator.store.run_progress import ProgressCallback

DEFAULT_POINTS, DEFAULT_LONGEST_S = 51, 15.0
DEFAULT_CHALLENGERS: Sequence[str] = CHALLENGER_KINDS
_ENVELOPE_PURPOSE = "How large and how long faults may be before a hazard follows."
_SEARCH_PURPOSE = "Which faults cause hazards, and how small and how short they can be."
_T = TypeVar("_T")


@dataclass(frozen=True, kw_only=True)
class Envelopes(Sequence[RunEnvelope]):
    """The envelopes of an exploration, in the order in which its planes were asked for."""

    run: Path  #: the run folder
    envelopes: tuple[RunEnvelope, ...]  #: an envelope for each fault, scenario and start that was begun
    summary: Summary | None  #: the summary of the bench; None if nothing was planned
    note: str = ""  #: what is unfinished; empty if nothing is

    def __len__(self) -> int:
        return len(self.envelopes)

    @overload
    def __getitem__(self, index: int) -> RunEnvelope: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[RunEnvelope, ...]: ...
    def __getitem__(self, index: int | slice) -> RunEnvelope | tuple[RunEnvelope, ...]:
        return self.envelopes[index]


def envelope(
    specs: str | Sequence[str],
    scenarios: "ScenarioLike | Sequence[ScenarioLike]",
    starts: "TriggerLike | Sequence[TriggerLike]",
    out: str | Path,
    *,
    points: int = DEFAULT_POINTS,
    longest_s: float = DEFAULT_LONGEST_S,
    observe_s: float = DEFAULT_OBSERVE_S,
    search: int = 120,
    validation: int = 86,
    seeds: int = 3,
    challengers: Sequence[str] = DEFAULT_CHALLENGERS,
    budget_s: float | None = None,
    target: str | None = None,
    campaign: str | Path | None = None,
    reading: str | None = None,
    seed: int = 0,
    workers: int = 1,
    engine: str | None = None,
    reuse: bool = True,
    cluster: str | None = None,
    insecure_network: bool = False,
    progress: ProgressCallback | None = None,
    workspace: WorkspaceLike = None,
) -> "Envelopes":
    """Find how large and how long faults may be before a hazard follows.

    Each variant of `specs` (names, `*` is a wildcard), scenario and start is a plane: magnitudes by
    durations, each with at most `points` values at equal distances of their logarithm. The search drives few
    of its cells. A validation then drives cells that were drawn from those called without hazard.

    * `starts`: times in s, or contexts of the hazard analysis: the first time at which the golden run is in
      it.
    * `longest_s`: the longest duration. `observe_s`: how long the drive must go on after a fault to count as
      without hazard.
    * `search`: the most runs of a plane's search; `validation`: the cells that are drawn, 0 for none.
    * `seeds`: how often each cell is driven if the fault has random numbers.
    * `challengers`: errors that change, which must be survived where the constant one is: `alternating`,
      `ramp`, `noise`, `glitch`.
    * `budget_s`: begin no batch after this time. The same call in the same folder goes on.
    * `campaign`: take target, canary and limits from a campaign.
    * `seed`: of the runs, and of what validation and proof draw. `reading`, `workers`, `engine`, `reuse`,
      `cluster`, `insecure_network`: as for `open_bench`; `progress`: as for `run`.

    The run folder `out` is that of a bench. If the target can stop a run, runs end at their first terminal
    hazard, and `observe_s` after their fault.

    MutatorError for invalid input, and if a golden run never reaches a start; CheckFailed if a golden run
    fails its checks.
    """
    check_whole_number("search", search, least=1)
    check_whole_number("validation", validation)
    check_number("observe_s", observe_s, least=0.0)
    selected_target, values = bench_values(
        open_workspace(workspace), target=target, campaign=campaign, reading=reading, seed=seed
    )
    planes = chosen_planes(
        selected_target,
        _listed(specs),
        _listed(scenarios),
        _listed(starts),
        magnitude_count=points,
        duration_count=points,
        longest_s=longest_s,
        seed=seed,
        reading=values["reading"],
        seeds=seeds,
        challengers=_listed(challengers),
    )
    section = ExplorationSection(
        planes=list(planes), observe_s=float(observe_s), search=search, validation=validation
    )
    with opened_exploration(
        selected_target,
        {**values, "name": "envelope", "about": _ENVELOPE_PURPOSE},
        section,
        Path(out),
        workers=workers,
        engine=engine,
        reuse=reuse,
        distributor=distributor_of_cluster(cluster, insecure_network=insecure_network),
        progress=progress,
    ) as bench:
        explored = explore_envelopes(
            bench, section, selected_target, values["reading"], within_budget(budget_s)
        )
    warn_of_end(bench.summary)
    return Envelopes(
        run=Path(out),
        envelopes=envelopes_of_replay(explored),
        summary=bench.summary,
        note=explored.note,
    )


@dataclass(frozen=True, kw_only=True)
class Findings(Sequence[Finding]):
    """What a search found: hazards of faults in scenarios from starts on, each with the smallest fault."""

    run: Path  #: the run folder
    findings: tuple[Finding, ...]  #: the findings, in the order of the planes
    planes: tuple[ExploredPlane, ...]  #: the planes that were searched
    #: the sum over planes of the share of cells that are at least as large and long as a hazardous one
    dominated: float
    summary: Summary | None  #: the summary of the bench; None if nothing was planned

    def __len__(self) -> int:
        return len(self.findings)

    @overload
    def __getitem__(self, index: int) -> Finding: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Finding, ...]: ...
    def __getitem__(self, index: int | slice) -> Finding | tuple[Finding, ...]:
        return self.findings[index]


def search(
    specs: str | Sequence[str],
    scenarios: "ScenarioLike | Sequence[ScenarioLike]",
    starts: "TriggerLike | Sequence[TriggerLike]",
    out: str | Path,
    *,
    budget: int = 300,
    strategy: Literal["planes", "random"] = "planes",
    longest_s: float = DEFAULT_LONGEST_S,
    target: str | None = None,
    campaign: str | Path | None = None,
    reading: str | None = None,
    seed: int = 0,
    workers: int = 1,
    engine: str | None = None,
    reuse: bool = True,
    cluster: str | None = None,
    insecure_network: bool = False,
    progress: ProgressCallback | None = None,
    workspace: WorkspaceLike = None,
) -> "Findings":
    """Search hazardous faults among all variants, scenarios and starts together, with `budget` runs.

    * `strategy`: `planes` learns which faults lead to hazards, and drives what promises most, new faults or
      smaller and shorter ones; `random` draws faults, to compare.
    * The other arguments are as for `envelope`. Each plane has 16 magnitudes and 9 durations.

    The run folder `out` is that of a bench. Errors are as for `envelope`.
    """
    check_whole_number("budget", budget, least=1)
    if strategy not in STRATEGIES:
        raise MutatorError(repr(strategy), argument="strategy", expected=describe_choices(STRATEGIES))
    selected_target, values = bench_values(
        open_workspace(workspace), target=target, campaign=campaign, reading=reading, seed=seed
    )
    planes = chosen_planes(
        selected_target,
        _listed(specs),
        _listed(scenarios),
        _listed(starts),
        magnitude_count=SEARCHED_MAGNITUDES,
        duration_count=SEARCHED_DURATIONS,
        longest_s=longest_s,
        seed=seed,
    )
    section = ExplorationSection(planes=list(planes), goal="find", strategy=strategy, budget=budget)
    with opened_exploration(
        selected_target,
        {**values, "name": "search", "about": _SEARCH_PURPOSE},
        section,
        Path(out),
        workers=workers,
        engine=engine,
        reuse=reuse,
        distributor=distributor_of_cluster(cluster, insecure_network=insecure_network),
        progress=progress,
    ) as bench:
        searched = search_findings(bench, section, selected_target, values["reading"])
    warn_of_end(bench.summary)
    return Findings(
        run=Path(out),
        findings=tuple(searched.findings()),
        planes=tuple(section.planes),
        dominated=sum(map(dominated_share, searched.planes)),
        summary=bench.summary,
    )


def _listed(values: _T | Sequence[_T]) -> list[_T]:
    return list(values) if isinstance(values, list | tuple) else [cast(_T, values)]
