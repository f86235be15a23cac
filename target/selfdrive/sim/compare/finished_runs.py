"""Runs to compare or plot, simulated or loaded from their folders."""

import json
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from selfdrive.common.errors import ConfigError
from selfdrive.sim.recorder import CHANNELS
from selfdrive.sim.run import simulate
from selfdrive.sim.scenario import Scenario, load_scenario

SCENARIOS_FOLDER = Path(__file__).parents[4] / "fault_library" / "scenarios"  # of the surrounding project
NO_LEAD_SUFFIX = "_nolead"  # suffix of a run's name if the lead was left out


@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedRun:
    """A finished run, with the contents of record.json and trace.npz."""

    name: str
    title: str
    record: dict
    trace: dict[str, np.ndarray]

    @property
    def free_road(self) -> bool:
        return self.record["no_lead"]


def load_scenario_of_run(name: str, scenarios: Path) -> Scenario:
    """The scenario of a run. Raises ConfigError if it is missing or invalid."""
    path = scenarios / f"{name.removesuffix(NO_LEAD_SUFFIX)}.yaml"
    if not path.is_file():
        raise ConfigError(
            f"no scenario for {name!r}",
            where=str(path),
            expected="a scenario file of that name",
            remedy="correct the name, or choose another --scenarios",
        )
    scenario = load_scenario(path)
    if name.endswith(NO_LEAD_SUFFIX):
        return replace(scenario, lead=None, title=f"{scenario.title}; without the lead")
    return scenario


def simulate_run(name: str, scenario: Scenario) -> FinishedRun:
    result = simulate(scenario, seed=0)
    return FinishedRun(name=name, title=scenario.title, record=result.record, trace=result.trace)


def load_run(folder: Path, plant: str) -> FinishedRun:
    """Load a finished run. Raises ConfigError if it is missing, or of another scenario or plant."""
    try:
        record = json.loads((folder / "record.json").read_text(encoding="utf-8"))
        with np.load(folder / "trace.npz", allow_pickle=False) as arrays:
            trace = {name: arrays[name] for name in CHANNELS}
        name = record["scenario"] + (NO_LEAD_SUFFIX if record["no_lead"] else "")
        got = f"a run of {name} on the {record['plant']} plant"
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        reason = error.strerror if isinstance(error, OSError) else f"unreadable: {error}"
        raise ConfigError(
            str(reason),
            where=str(folder),
            expected="record.json and trace.npz of a finished run",
            remedy="run the scenario with this folder as --out",
        ) from None
    if got != (expected_run := f"a run of {folder.name} on the {plant} plant"):
        raise ConfigError(
            got,
            where=str(folder),
            expected=expected_run,
            remedy="run that with this --out, or correct --plant",
        )
    return FinishedRun(name=name, title=record["scenario"], record=record, trace=trace)
