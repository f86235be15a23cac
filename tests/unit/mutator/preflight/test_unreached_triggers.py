"""Triggers that no golden run reaches."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.model import Experiment, Trigger
from mutator.preflight.preflight_checks import describe_unreached_triggers, run_checks
from mutator.preflight.unreached_triggers import describe_unreached, load_observations, save_observations
from mutator.triggers.trigger_kinds import trigger_at_time
from mutator.workspace import Workspace

MakeExperiment = Callable[..., Experiment]
# observations of the toy: t, d_rel, v_ego, v_lead; the headway time is 2 s, 1 s, 2 s
SEEN = [(0.0, 40.0, 20.0, 18.0), (1.0, 20.0, 20.0, 18.0), (2.0, 40.0, 20.0, 18.0)]


@pytest.mark.parametrize(
    ("trigger", "said"),
    [
        (trigger_at_time(2.0), []),
        (trigger_at_time(2.1), ["the scenario ends before the time of", "(S1, which ends at 2 s: 2)"]),
        (Trigger(name="near", condition="hwt <= 1.5"), []),
        (Trigger(name="near", condition="hwt <= 1.5", armed_after_s=1.5), ["near in S1: 2"]),
        (Trigger(name="nearer", condition="hwt <= 0.9"), ["no golden run reaches", "nearer in S1: 2"]),
        (Trigger(name="always", condition="True"), []),
    ],
)
def test_triggers_that_never_hold_are_reported(
    toycar: Workspace, experiment: MakeExperiment, trigger: Trigger, said: list[str]
) -> None:
    waiting = [("S1", replace(experiment(value), trigger=trigger)) for value in (1.0, 2.0)]
    told = describe_unreached(
        toycar,
        toycar.manifest("toycar"),
        [*waiting, ("S2", replace(experiment(), trigger=trigger))],  # S2 is unknown
        {"S1": np.array(SEEN)},
    )
    assert len(told) == bool(said)
    for part in ["2 of 3 experiments", *said] if said else []:
        assert part in told[0]


def test_observations_are_read_for_each_golden_run(tmp_path: Path) -> None:
    assert load_observations(tmp_path) == {}
    save_observations(tmp_path, "town/A+alone", SEEN)
    assert {key: rows.tolist() for key, rows in load_observations(tmp_path).items()} == {
        "town/A+alone": [list(row) for row in SEEN]
    }


def test_triggers_are_checked_with_cached_golden_runs(toycar: Workspace, tmp_path: Path) -> None:
    campaign = toycar.library / "campaigns" / "small.yaml"
    text = campaign.read_text().replace("methods: [guided, random]", "methods: [guided]")
    campaign.write_text(text.replace("table: near_far", "list: [{when: v_ego > 99}, {at_s: 50}]"))
    for name in ("fresh", "cached"):
        folder = freeze_plan(build_plan(toycar, "small"), tmp_path / name, toycar)
        run_checks(toycar, folder)
        late, never = describe_unreached_triggers(toycar, folder)
        assert late.startswith("the scenario ends before the time of 3 of 6 experiments, which")
        assert "v_ego > 99.0 in A: 3" in never
        assert (folder.path / "checks.json").is_file()
    again = freeze_plan(build_plan(toycar, "small"), tmp_path / name, toycar)
    folder.path.joinpath("work").rename(tmp_path / "gone")
    run_checks(toycar, again)
    assert describe_unreached_triggers(toycar, again) == []
