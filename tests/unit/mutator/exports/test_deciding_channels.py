"""The channel that decides an experiment."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mutator.exports.deciding_channels import channel_history, deciding_channel
from mutator.model import Outcome, Record
from mutator.outcomes.series_sampling import write_sampled_series
from mutator.store.run_folder import RunFolder
from mutator.targets.hazard_and_metric_definitions import Hazard
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

CHANNELS = ("gas", "brake", "wheel_turn", "gap", "speed")


@pytest.fixture
def manifest(toycar: Workspace) -> TargetManifest:
    return toycar.manifest("toycar")


@pytest.mark.parametrize(
    ("rule", "channel"),
    [
        (Hazard(name="H1", when="speed > 3 and gap <= 0", margin="gap"), "gap"),
        (Hazard(name="H1", when="t > 3 and speed < 3 and gap > 0"), "speed"),
        (Hazard(name="H1", required_stl="always(gap > 0)"), "gap"),
        (Hazard(name="H1"), "brake"),  # the target's record reports it
        (Hazard(name="H2", when="gap <= 0"), "brake"),
    ],
)
def test_the_channel_is_the_first_in_the_hazards_formulas(
    rule: Hazard, channel: str, manifest: TargetManifest, record: Callable[..., Record]
) -> None:
    """If they name none, it is the actuator that changed first."""
    with_rule = replace(manifest, hazard_rules=(rule,))
    one = record(first_change=("brake", "higher"))
    assert deciding_channel(with_rule, "H1", one, CHANNELS) == channel


def test_without_target_or_hazard_it_is_the_actuator_that_changed_first(
    manifest: TargetManifest, record: Callable[..., Record]
) -> None:
    assert deciding_channel(None, "H1", record(first_change=("gas", "lower")), CHANNELS) == "gas"
    assert deciding_channel(manifest, None, record(), CHANNELS) is None


@pytest.fixture
def run(
    toycar: Workspace, tmp_path: Path, manifest: TargetManifest, write_run: Callable[..., Path]
) -> RunFolder:
    """A run whose fault adds 1 to `gas` from 2 s and ends in a hazard at 4 s."""
    fields = {
        "outcome": Outcome.HAZARD,
        "hazards": (("H1", 4.0),),
        "max_dev": (("gas", 1.0), ("brake", 0.0), ("wheel_turn", 0.0)),
        "t_manifest": 2.0,
        "first_change": ("gas", "higher"),
    }
    folder = RunFolder.open(write_run(toycar, tmp_path / "run", lambda e: fields))
    return folder


def keep(run: RunFolder, manifest: TargetManifest, record: Record, until: float = 8.0) -> None:
    t = np.arange(0.0, until, 0.05)
    golden = {"time": t, **{name: np.zeros(len(t)) for name in CHANNELS}}
    write_sampled_series(run.path, manifest, golden, golden | {"gas": np.where(t < 2.0, 0.0, 1.0)}, record)


def test_the_history_reaches_from_before_the_fault_to_after_the_hazard(
    run: RunFolder, manifest: TargetManifest
) -> None:
    first, *_ = run.records().values()
    keep(run, manifest, first)
    history = channel_history(run, first, "H1", manifest, before=(run, first))
    assert history is not None
    assert (history.name, history.t[0], history.t[-1]) == ("gas", 0.0, 5.0)
    assert history.golden is not None and not history.golden.any()
    assert history.before is not None
    for faulty in (history.faulty, history.before):
        assert faulty.tolist() == np.where(history.t < 2.0, 0.0, 1.0).tolist()


def test_an_experiment_without_a_series_has_no_history(run: RunFolder, manifest: TargetManifest) -> None:
    first, second, *_ = run.records().values()
    keep(run, manifest, first)
    assert channel_history(run, second, "H1", manifest) is None
    history = channel_history(run, first, "H1", manifest, before=(run, second))
    assert history is not None
    assert history.before is None


def test_a_run_that_ended_before_the_hazard_has_no_line(
    run: RunFolder,
    manifest: TargetManifest,
    toycar: Workspace,
    tmp_path: Path,
    write_run: Callable[..., Path],
) -> None:
    """Values that it never had must not be drawn."""
    first, second, *_ = run.records().values()
    keep(run, manifest, first)
    keep(run, manifest, second, until=3.0)
    history = channel_history(run, first, "H1", manifest, before=(run, second))
    assert history is not None
    assert history.before is None
