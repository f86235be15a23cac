"""Forgeries of the request, records and envelopes of an exploration, whose digests were all redone."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.exploration_forging import (
    Explored,
    Reseal,
    batches_of,
    check_finds,
    edit_campaign,
    edit_envelopes,
    edit_head,
    edit_record,
)

# What a forger edits. The digests are redone afterwards.


def the_exploration(run: Path) -> None:
    edit_campaign(run, r"\nexplore: .*\n", "\n")


def the_seed_of_the_draw(run: Path) -> None:
    edit_campaign(run, r"\nseed: 0\n", "\nseed: 1\n")
    edit_head(run, seed=1)


def the_size_of_the_draw(run: Path) -> None:
    edit_campaign(run, '"validation": 6', '"validation": 5')


def the_window(run: Path) -> None:
    edit_campaign(run, '"observe_s": 0.5', '"observe_s": 3.0')


def a_magnitude(run: Path) -> None:
    edit_campaign(run, r'"magnitudes": \[[0-9.]+,', '"magnitudes": [0.001,')


def the_budget_of_the_search(run: Path) -> None:
    edit_campaign(run, '"search": 120', '"search": 4')


def the_size_of_batches(run: Path) -> None:
    edit_campaign(run, '"batch": 16', '"batch": 15')


def a_hazard_made_harmless(run: Path) -> None:
    first = {e.id for e in batches_of(run)[0]}
    edit_record(
        run,
        lambda record: record["outcome"] == "hazard" and record["experiment_id"] in first,
        outcome="sdc",
        hazards=[],
    )


def a_harmless_run_made_hazardous(run: Path) -> None:
    first = {e.id for e in batches_of(run)[0]}
    edit_record(
        run,
        lambda record: record["outcome"] != "hazard" and record["experiment_id"] in first,
        outcome="hazard",
        hazards=[["H3", 1.2]],
    )


def a_cell(run: Path) -> None:
    def edit(plane: dict[str, Any]) -> None:
        plane["cells"][-1] = plane["cells"][-1].replace("H", "o", 1)

    edit_envelopes(run, edit)


def a_curve(run: Path) -> None:
    edit_envelopes(run, lambda plane: plane["longest_survived_s"].__setitem__(-1, 4.0))


def a_validation(run: Path) -> None:
    edit_envelopes(run, lambda plane: plane["validations"][0].update(frame=1000))


def a_drawn_cell(run: Path) -> None:
    edit_envelopes(run, lambda plane: plane["validations"][0]["drawn"].pop())


def a_boundary_pair(run: Path) -> None:
    def edit(plane: dict[str, Any]) -> None:
        pair = next(pair for pair in plane["pairs"] if pair)
        pair["hazardous"] = pair["without_hazard"]

    edit_envelopes(run, edit)


FORGERIES = (
    the_exploration,
    the_seed_of_the_draw,
    the_size_of_the_draw,
    the_window,
    a_magnitude,
    the_budget_of_the_search,
    the_size_of_batches,
    a_hazard_made_harmless,
    a_harmless_run_made_hazardous,
    a_cell,
    a_curve,
    a_validation,
    a_drawn_cell,
    a_boundary_pair,
)


@pytest.mark.parametrize("forge", FORGERIES, ids=lambda forge: forge.__name__)
def test_forged_results_are_found(
    exploration: Explored, explored_run: Path, reseal: Reseal, forge: Callable[[Path], None]
) -> None:
    """The proposals no longer follow from the records, or the envelopes do not."""
    check_finds(exploration, explored_run, reseal, forge)
