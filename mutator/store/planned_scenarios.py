"""Concrete scenarios of a run folder: one line each in `plan/scenarios.jsonl`, with the golden runs of each.

A target reads a file; a scenario becomes one in the run's scratch folder when it is first needed.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below
from mutator._common.files import raising_disk_full, write_atomic
from mutator._common.hashing import canonical_json, parse_json
from mutator._common.library_and_run_folder_search import SCRATCH_FOLDER
from mutator.errors import MutatorError
from mutator.model import ConcreteScenario
from mutator.store.golden_runs import GoldenRun
from mutator.store.plan_lines import (
    DAMAGED_PLAN_REMEDY,
    concrete_as_json,
    concrete_from_json,
    read_plan_lines,
)

SCENARIOS_FILE = "plan/scenarios.jsonl"


@dataclass(frozen=True, kw_only=True)
class PlannedScenario:
    """A concrete scenario of a plan, and its golden runs."""

    scenario: ConcreteScenario
    goldens: tuple[GoldenRun, ...]

    def line(self) -> bytes:
        """Return the scenario as a line of the plan."""
        goldens = [golden.to_stored()[1:] for golden in self.goldens]  # without the scenario's name
        values = {"goldens": goldens, "name": self.scenario.name}
        return canonical_json(concrete_as_json(self.scenario) | values).encode() + b"\n"


@dataclass(frozen=True)
class PlannedScenarios:
    """The concrete scenarios of the run folder `run`, read when they are needed."""

    run: Path

    @cached_property
    def by_name(self) -> dict[str, PlannedScenario]:
        scenarios: dict[str, PlannedScenario] = {}
        for planned in self._read():
            # the plan of a bench names a scenario again when it has another golden run
            before = scenarios.get(planned.scenario.name)
            scenarios[planned.scenario.name] = (
                replace(before, goldens=before.goldens + planned.goldens) if before else planned
            )
        return scenarios

    def add(self, scenario: ConcreteScenario) -> None:
        """Add a scenario that is going to be planned."""
        self.by_name.setdefault(scenario.name, PlannedScenario(scenario=scenario, goldens=()))

    @property
    def families(self) -> tuple[str, ...]:
        """The names of the families, sorted."""
        return tuple(sorted({planned.scenario.family for planned in self.by_name.values()}))

    def golden_runs(self) -> Iterator[GoldenRun]:
        """Yield the golden runs of all scenarios."""
        return chain.from_iterable(planned.goldens for planned in self.by_name.values())

    def file(self, name: str) -> Path:
        """Return a file with the text of a scenario of the plan, in the scratch folder of the run."""
        path = path_below(self.run / SCRATCH_FOLDER / "scenarios", f"{name}.yaml")
        data = self.by_name[name].scenario.text.encode()
        if not path.is_file() or read_bounded(path) != data:  # a mutant can write there, too
            with raising_disk_full(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                write_atomic(path, data)
        return path

    def problems(self, digest_by_scenario: Mapping[str, str]) -> Iterator[MutatorError]:
        """Yield a problem for each scenario that no experiment has, or that has another text."""
        path = self.run / SCENARIOS_FILE
        for number, (name, planned) in enumerate(self.by_name.items(), start=1):
            expected = digest_by_scenario.get(name)
            if planned.scenario.digest != expected:
                got = (
                    f"scenario {name}, which no experiment has"
                    if expected is None
                    else f"scenario {name} with another text than its experiments have"
                )
                yield MutatorError(got, where=path, line=number, remedy=DAMAGED_PLAN_REMEDY)

    def _read(self) -> Iterator[PlannedScenario]:
        path = self.run / SCENARIOS_FILE
        if not path.is_file():
            return
        for number, line in enumerate(read_plan_lines(path), start=1):
            try:
                planned = _parse(parse_json(line))
                if planned.line() != line:
                    raise ValueError("not canonical")
            except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
                raise MutatorError(
                    "not a scenario of a plan", where=path, line=number, remedy=DAMAGED_PLAN_REMEDY
                ) from None
            yield planned


def planned_scenarios_of(run: Path) -> PlannedScenarios | None:
    """Return the concrete scenarios of a run folder; None if its plan has none."""
    try:
        state = (run / SCENARIOS_FILE).stat()
    except OSError:
        return None
    return _cached_scenarios(run, state.st_mtime_ns, state.st_size)


def concrete_scenarios_of(run: Path) -> dict[str, ConcreteScenario]:
    """Return the concrete scenarios of a run folder by name, in the order of the plan."""
    planned = planned_scenarios_of(run)
    return {name: each.scenario for name, each in planned.by_name.items()} if planned else {}


@lru_cache(maxsize=2)  # those of ten thousand scenarios take 20 MB
def _cached_scenarios(run: Path, changed_ns: int, size: int) -> PlannedScenarios:
    return PlannedScenarios(run)


def _parse(values: Mapping[str, Any]) -> PlannedScenario:
    scenario = concrete_from_json(values)
    goldens = tuple(GoldenRun.from_stored([scenario.name, *rest]) for rest in values["goldens"])
    return PlannedScenario(scenario=scenario, goldens=goldens)


def scenario_lines(scenarios: Iterable[PlannedScenario]) -> bytes:
    """Return the content of `plan/scenarios.jsonl`."""
    return b"".join(planned.line() for planned in scenarios)
