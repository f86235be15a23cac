"""Forgeries of what challengers inject and of what they show, whose digests were all redone."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mutator.model import Experiment, Hold, Method
from tests.e2e.exploration_forging import (
    Explored,
    Reseal,
    batches_of,
    check_finds,
    edit_campaign,
    edit_envelopes,
    edit_record,
    replace_in_batch,
    write_batches,
)

# What a forger edits. The digests are redone afterwards.


def challenger_of(run: Path) -> tuple[int, int]:
    """Return batch and number of the first challenger."""
    return next(
        (n, i)
        for n, batch in enumerate(batches_of(run))
        for i, experiment in enumerate(batch)
        if "~" in experiment.fault.spec
    )


def with_injection(experiment: Experiment, **values: Any) -> Experiment:
    [injection] = experiment.fault.injections
    return replace(experiment, fault=replace(experiment.fault, injections=(replace(injection, **values),)))


def with_params(experiment: Experiment, **values: Any) -> Experiment:
    [injection] = experiment.fault.injections
    return with_injection(experiment, params=tuple(sorted({**dict(injection.params), **values}.items())))


def edit_challenger(run: Path, forged: Callable[[Experiment], Experiment], form: str = "") -> None:
    """Edit the first challenger, or the first of a form."""
    number = next(
        (n, i)
        for n, batch in enumerate(batches_of(run))
        for i, experiment in enumerate(batch)
        if f"~{form}" in experiment.fault.spec
    )
    replace_in_batch(run, *number, forged)


def a_challenger_made_hazardous(run: Path) -> None:
    names = {e.id for batch in batches_of(run) for e in batch if "~" in e.fault.spec}
    edit_record(
        run,
        lambda record: record["outcome"] == "sdc" and record["experiment_id"] in names,
        outcome="hazard",
        hazards=[["H3", 1.2]],
    )


def another_challenger(run: Path) -> None:
    replace_in_batch(
        run,
        *challenger_of(run),
        lambda e: replace(e, fault=replace(e.fault, spec="sensor/lane/shifted~ramp_2")),
    )


def a_challenger_of_another_shape(run: Path) -> None:
    edit_challenger(run, lambda e: with_params(e, period=100.0))


def a_ramp_that_hardly_grows(run: Path) -> None:
    edit_challenger(run, lambda e: with_params(e, period=1e6), "ramp")


def a_glitch_shorter_than_a_step(run: Path) -> None:
    edit_challenger(run, lambda e: with_params(e, width=1e-6), "glitch")


def a_challenger_of_a_smaller_size(run: Path) -> None:
    edit_challenger(run, lambda e: with_params(e, by=0.001))


def a_challenger_of_hardly_another_size(run: Path) -> None:
    edit_challenger(run, lambda e: with_params(e, by=dict(e.fault.injections[0].params)["by"] * 1.001))


def a_challenger_with_a_bound(run: Path) -> None:
    edit_challenger(run, lambda e: with_params(e, low=0.0, high=0.0))


def a_challenger_of_another_variable(run: Path) -> None:
    edit_challenger(run, lambda e: with_params(e, target="other"))


def a_challenger_with_another_seed(run: Path) -> None:
    edit_challenger(run, lambda e: with_params(e, seed=1), "noise")


def a_challenger_at_another_place(run: Path) -> None:
    def forged(experiment: Experiment) -> Experiment:
        [injection] = experiment.fault.injections
        return with_injection(experiment, location=replace(injection.location, function="Driver.other"))

    edit_challenger(run, forged)


def a_challenger_of_another_model(run: Path) -> None:
    edit_challenger(run, lambda e: with_injection(e, model="offset"))


def a_challenger_in_one_place_only(run: Path) -> None:
    edit_challenger(run, lambda e: with_injection(e, where="t < 0"))


def a_challenger_of_one_execution(run: Path) -> None:
    edit_challenger(run, lambda e: with_injection(e, call=1))


def a_challenger_of_every_hundredth_execution(run: Path) -> None:
    edit_challenger(run, lambda e: with_injection(e, every=100))


def a_challenger_without_injections(run: Path) -> None:
    edit_challenger(run, lambda e: replace(e, fault=replace(e.fault, injections=())))


def a_challenger_with_a_hold_of_its_spec(run: Path) -> None:
    edit_challenger(run, lambda e: replace(e, fault=replace(e.fault, hold=Hold.TO_END)))


def a_challenger_in_another_unit(run: Path) -> None:
    edit_challenger(run, lambda e: replace(e, fault=replace(e.fault, unit="km")))


def a_challenger_that_is_armed_later(run: Path) -> None:
    edit_challenger(run, lambda e: replace(e, trigger=replace(e.trigger, armed_after_s=2.0)))


def a_challenger_from_another_start_on(run: Path) -> None:
    edit_challenger(run, lambda e: replace(e, trigger=replace(e.trigger, condition="t >= 2.0")))


def a_challenger_for_another_time(run: Path) -> None:
    edit_challenger(run, lambda e: replace(e, trigger=replace(e.trigger, hold_s=0.05)))


def a_challenger_of_another_name(run: Path) -> None:
    edit_challenger(run, lambda e: replace(e, trigger=replace(e.trigger, name="at 3 s")))


def a_challenger_of_another_run_seed(run: Path) -> None:
    edit_challenger(run, lambda e: replace(e, seed=e.seed + 1))


def a_challenger_chosen_at_random(run: Path) -> None:
    edit_challenger(run, lambda e: replace(e, method=Method.RANDOM))


def a_smaller_constant_error(run: Path) -> None:
    replace_in_batch(run, 0, 0, lambda e: with_params(e, by=0.001))


def a_constant_error_at_another_place(run: Path) -> None:
    replace_in_batch(run, 0, 0, lambda e: with_injection(e, where="t < 0"))


def a_dropped_challenger(run: Path) -> None:
    batches = batches_of(run)
    batch, number = challenger_of(run)
    batches[batch] = [e for i, e in enumerate(batches[batch]) if i != number]
    write_batches(run, batches)


def the_challengers(run: Path) -> None:
    edit_campaign(run, r'"challengers": \["[a-z0-9_.]+", ', '"challengers": [')


def a_challenged_bound(run: Path) -> None:
    edit_envelopes(run, lambda plane: plane["challenges"][0].update(survived=[0, 0]))


FORGERIES = (
    a_challenger_made_hazardous,
    another_challenger,
    a_challenger_of_another_shape,
    a_ramp_that_hardly_grows,
    a_glitch_shorter_than_a_step,
    a_challenger_of_a_smaller_size,
    a_challenger_of_hardly_another_size,
    a_challenger_with_a_bound,
    a_challenger_of_another_variable,
    a_challenger_with_another_seed,
    a_challenger_at_another_place,
    a_challenger_of_another_model,
    a_challenger_in_one_place_only,
    a_challenger_of_one_execution,
    a_challenger_of_every_hundredth_execution,
    a_challenger_without_injections,
    a_challenger_with_a_hold_of_its_spec,
    a_challenger_in_another_unit,
    a_challenger_that_is_armed_later,
    a_challenger_from_another_start_on,
    a_challenger_for_another_time,
    a_challenger_of_another_name,
    a_challenger_of_another_run_seed,
    a_challenger_chosen_at_random,
    a_smaller_constant_error,
    a_constant_error_at_another_place,
    a_dropped_challenger,
    the_challengers,
    a_challenged_bound,
)


@pytest.mark.parametrize("forge", FORGERIES, ids=lambda forge: forge.__name__)
def test_a_forged_challenger_is_found(
    exploration: Explored, explored_run: Path, reseal: Reseal, forge: Callable[[Path], None]
) -> None:
    """A challenger is all that follows from the constant error: code, place, sizes, window and seed."""
    check_finds(exploration, explored_run, reseal, forge)
