"""Shares of a sample are weighted, so that they estimate those of the plan from which it was drawn."""

import json
from pathlib import Path

import pandas as pd
import pytest
import yaml

from mutator._common.hashing import as_json_types
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorError
from mutator.statistics.sample_weights import WEIGHT_COLUMN, sampled_plan, with_weights
from mutator.statistics.weighted_shares import share_of_runs
from mutator.store.plan_choices import Choices
from mutator.store.plan_strata import STRATA_FILE, PlanStrata, SampleDraw, load_strata
from mutator.workspace import Workspace
from tests.made_head import made_head


def planned_frame(run: Path) -> pd.DataFrame:
    """Return the plan of a run folder as if each experiment had a result."""
    return pd.read_csv(run / "plan.csv", dtype=str, keep_default_na=False)


@pytest.mark.parametrize("choices", [Choices(limit=6), Choices(limit=6, proportional=True)])
def test_weights_add_up_to_each_stratum_of_the_plan(
    toycar: Workspace, tmp_path: Path, choices: Choices
) -> None:
    whole = build_plan(toycar, "small")
    run = freeze_plan(build_plan(toycar, "small", choices), tmp_path / "run", toycar).path
    frame = with_weights(planned_frame(run), run)
    assert len(frame) == 6 < len(whole.experiments)
    strata, sample = load_strata(run), sampled_plan(frame, run)
    assert strata is not None and sample is not None
    assert strata.draw is (SampleDraw.PROPORTIONAL if choices.proportional else SampleDraw.EVEN)
    assert strata == PlanStrata.of_experiments(strata.draw, whole.experiments)
    left_out = len(whole.experiments) - frame[WEIGHT_COLUMN].sum()
    assert sample.left_out_count == pytest.approx(left_out)


def test_a_whole_plan_has_no_weights_and_no_strata(toycar: Workspace, tmp_path: Path) -> None:
    """Also with a limit that leaves out nothing."""
    for name, choices in {
        "a": Choices(),
        "b": Choices(limit=100_000),
        "c": Choices(only="value > 1"),
    }.items():
        run = freeze_plan(build_plan(toycar, "small", choices), tmp_path / name, toycar).path
        assert WEIGHT_COLUMN not in with_weights(planned_frame(run), run)
        assert not (run / STRATA_FILE).exists()


def test_filters_come_before_the_strata(toycar: Workspace) -> None:
    only = 'method == "guided"'
    whole = build_plan(toycar, "small", Choices(only=only)).experiments
    strata = build_plan(toycar, "small", Choices(only=only, limit=2)).strata
    assert strata is not None and strata.experiment_count == len(whole)


@pytest.mark.parametrize(
    ("campaign", "is_even"),
    [({"sample": 1}, True), ({"sample": 1, "proportional": True}, False), ({}, False), ([], False)],
)
def test_an_even_sample_without_strata_has_no_rates(tmp_path: Path, campaign: object, is_even: bool) -> None:
    (tmp_path / "run.json").write_text(json.dumps(made_head(choices=as_json_types(Choices()))))
    (tmp_path / "campaign.yaml").write_text(yaml.safe_dump(campaign))
    frame = with_weights(pd.DataFrame({"fault_id": ["a", "b"]}), tmp_path)
    assert (WEIGHT_COLUMN in frame) == is_even
    if is_even:
        flags = pd.Series([True, False])
        assert str(share_of_runs(frame, flags, flags | True)) == "- (1/2)"


@pytest.mark.parametrize(
    "text", ["", "{}\n", '{"draw":"even"}\n{"experiments":0,"stratum":["a"]}\n', "[1]\n"]
)
def test_damaged_strata_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "plan").mkdir()
    (tmp_path / STRATA_FILE).write_text(text)
    with pytest.raises(MutatorError, match="not the strata of a plan"):
        load_strata(tmp_path)


def test_a_weighted_share_is_that_of_the_plan() -> None:
    """Of stratum A, 10 of 100 planned runs were drawn, all hazards; of B, 10 of 300, none."""
    frame = pd.DataFrame({"fault_id": [f"f{i}" for i in range(20)], "weight": [10.0] * 10 + [30.0] * 10})
    hazards = pd.Series([True] * 10 + [False] * 10)
    share = share_of_runs(frame, hazards, hazards | True)
    assert (share.count, share.of, share.rate) == (10, 20, 0.25)
    assert share.low < 0.25 < share.high


@pytest.mark.parametrize("is_hazard", [False, True])
def test_a_share_that_no_draw_changes_still_has_an_interval(is_hazard: bool) -> None:
    """It is Wilson's for 12.8 runs, which the unequal weights of 16 runs are worth (by hand)."""
    frame = pd.DataFrame({"fault_id": [f"f{i}" for i in range(16)], "weight": [1.0] * 8 + [3.0] * 8})
    flags = pd.Series([is_hazard] * 16)
    share = share_of_runs(frame, flags, flags | True)
    width = 3.8415 / (12.8 + 3.8415)
    assert (share.low, share.high) == pytest.approx((1 - width, 1) if is_hazard else (0, width), abs=1e-4)
