"""Explorations: how large and how long a fault may be before a hazard follows."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TypeVar, cast, overload

from mutator._common.argument_checks import check_number, check_whole_number
from mutator._common.message_text import spelling_suggestion
from mutator.api.benches import bench_values, distributor_of_cluster, warn_of_end
from mutator.api.experiments import ExperimentBuilder
from mutator.api.scenario_choice import ScenarioLike, concrete_scenario_of
from mutator.api.target_and_fault_selection import (
    SelectedTarget,
    TriggerLike,
    WorkspaceLike,
    context_or_parsed_trigger,
    open_workspace,
)
from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.config.units import UNITS
from mutator.errors import MutatorError
from mutator.execution.bench_opening import finishing, opened_bench
from mutator.execution.session_summary import Summary
from mutator.explore.envelope import Envelope
from mutator.explore.exploration_run import run_exploration
from mutator.explore.lattice import durations_between
from mutator.explore.plane_building import magnitudes_by_sign
from mutator.families.family import argument_of
from mutator.faults.fault_specs import Variant
from mutator.model import Experiment
from mutator.store.run_progress import ProgressCallback

DEFAULT_POINTS, DEFAULT_LONGEST_S, DEFAULT_OBSERVE_S = 51, 15.0, 15.0
_NAME, _ABOUT = "envelope", "How large and how long faults may be before a hazard follows."
_T = TypeVar("_T")


@dataclass(frozen=True, kw_only=True)
class Envelopes(Sequence[Envelope]):
    """The envelopes of an exploration, in the order in which its planes were asked for."""

    run: Path  #: the run folder
    envelopes: tuple[Envelope, ...]  #: an envelope for each fault, scenario and start
    summary: Summary | None  #: the summary of the bench; None if nothing was planned

    def __len__(self) -> int:
        return len(self.envelopes)

    @overload
    def __getitem__(self, index: int) -> Envelope: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Envelope, ...]: ...
    def __getitem__(self, index: int | slice) -> Envelope | tuple[Envelope, ...]:
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
    * `budget_s`: begin no batch after this time. The same call in the same folder goes on.
    * `campaign`: take target, canary and limits from a campaign.
    * `seed`: of the runs, and of what validation and proof draw. `reading`, `workers`, `engine`, `reuse`,
      `cluster`, `insecure_network`: as for `open_bench`; `progress`: as for `run`.

    The run folder `out` is that of a bench. MutatorError for invalid input, and if a golden run never reaches
    a start; CheckFailed if a golden run fails its checks.
    """
    for name, value in (("points", points), ("search", search), ("workers", workers)):
        check_whole_number(name, value, least=1)
    check_whole_number("validation", validation)
    check_whole_number("seed", seed)
    check_number("longest_s", longest_s, least=0.0)
    check_number("observe_s", observe_s, least=0.0)
    opened_workspace = open_workspace(workspace)
    selected_target, values = bench_values(
        opened_workspace, target=target, campaign=campaign, reading=reading, seed=seed
    )
    builder = ExperimentBuilder(selected_target)
    section = ExplorationSection(
        planes=list(
            _planes(
                selected_target,
                [specs] if isinstance(specs, str) else list(specs),
                _listed(scenarios),
                _listed(starts),
                points=points,
                longest_s=longest_s,
                seed=seed,
            )
        ),
        observe_s=float(observe_s),
        search=search,
        validation=validation,
    )
    end = None if budget_s is None else time.monotonic() + budget_s

    def build(plane: ExploredPlane, magnitude: float | None, start_s: float, duration_s: float) -> Experiment:
        return builder.build(
            plane.spec,
            plane.scenario,
            start_s,
            value=magnitude,
            hold_s=duration_s,
            seed=plane.seed,
            reading=values["reading"],
            beyond=True,
        )

    with (
        opened_bench(
            opened_workspace,
            Path(out),
            {
                **values,
                "name": _NAME,
                "about": "How large and long faults may be.",
                "explore": asdict(section),
            },
            workers=workers,
            engine=engine,
            reuse=reuse,
            distributor=distributor_of_cluster(cluster, insecure_network=insecure_network),
            notify=progress,
        ) as bench,
        finishing(bench),
    ):
        exploration = run_exploration(
            bench,
            selected_target.manifest,
            section,
            seed,
            build,
            may_begin=lambda: end is None or time.monotonic() < end,
        )
    warn_of_end(bench.summary)
    envelopes = tuple(Envelope(plane) for plane in exploration.planes)
    return Envelopes(run=Path(out), envelopes=envelopes, summary=bench.summary)


def _planes(
    selected_target: SelectedTarget,
    names: Sequence[str],
    scenarios: Sequence[ScenarioLike],
    starts: Sequence[TriggerLike],
    *,
    points: int,
    longest_s: float,
    seed: int,
) -> Iterator[ExploredPlane]:
    workspace, manifest = selected_target.workspace, selected_target.manifest
    durations = durations_between(manifest.step_s, longest_s, points, manifest.step_s)
    triggers = [
        context_or_parsed_trigger(
            workspace, str(start), manifest.armed_after_s, manifest.observation.variables
        )
        for start in starts
    ]
    for spec, variant in _chosen_variants(selected_target, names):
        unit = UNITS[variant.draw.unit].symbol if variant.draw and variant.draw.unit else ""
        for magnitudes in magnitudes_by_sign(variant, points):
            for scenario in scenarios:
                concrete = concrete_scenario_of(workspace, scenario)
                for start, trigger in zip(starts, triggers, strict=True):
                    yield ExploredPlane(
                        spec=f"{spec}/{variant.name}",
                        scenario=argument_of(concrete) if concrete else str(scenario),
                        start=str(start),
                        condition=trigger.condition,
                        armed_after_s=trigger.armed_after_s,
                        magnitudes=magnitudes,
                        unit=unit,
                        durations_s=list(durations),
                        seed=seed,
                    )


def _chosen_variants(selected_target: SelectedTarget, names: Sequence[str]) -> Iterator[tuple[str, Variant]]:
    """Yield the variants that the names choose, each with its spec's name, in the library's order."""
    specs = selected_target.workspace.specs()
    variants = [(spec.name, variant) for spec in specs for variant in spec]
    full_names = [f"{spec}/{variant.name}" for spec, variant in variants]
    for name in names:
        if not any(_is_chosen(full_name, name) for full_name in full_names):
            raise MutatorError(
                f"no fault '{name}'",
                argument="specs",
                expected="a spec or a variant of the library, such as " + full_names[0],
                remedy="`mutator list faults` lists them" + spelling_suggestion(name, full_names),
            )
    for (spec, variant), full_name in zip(variants, full_names, strict=True):
        if any(_is_chosen(full_name, name) for name in names):
            yield spec, variant


def _is_chosen(full_name: str, name: str) -> bool:
    return fnmatchcase(full_name, name) or full_name.startswith(f"{name}/")


def _listed(values: _T | Sequence[_T]) -> list[_T]:
    return list(values) if isinstance(values, list | tuple) else [cast(_T, values)]
