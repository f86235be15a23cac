"""Forgeries of the plan of an exploration, whose digests were all redone: records do not give it."""

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.model import AfterHazard, Experiment, Hold, Method
from tests.e2e.exploration_forging import (
    Explored,
    Reseal,
    batches_of,
    check_finds,
    reasons_of,
    replace_in_batch,
    write_batches,
)

# What a forger edits. The digests are redone afterwards.


def a_moved_border(run: Path) -> None:
    first, second, *others = batches_of(run)
    write_batches(run, [first, second[:-1], [second[-1], *others[0]], *others[1:]])


def a_merged_batch(run: Path) -> None:
    first, second, *others = batches_of(run)
    write_batches(run, [[*first, *second], *others])


def a_split_batch(run: Path) -> None:
    first, *others = batches_of(run)
    write_batches(run, [first[:1], first[1:], *others])


def a_reason(run: Path) -> None:
    reasons = reasons_of(run)
    write_batches(run, batches_of(run), [*reasons[:-1], "exploration, by hand"])


def swapped_batches(run: Path) -> None:
    first, second, third, *others = batches_of(run)
    write_batches(run, [first, third, second, *others])


def swapped_experiments(run: Path) -> None:
    first, second, *others = batches_of(run)
    write_batches(run, [first, [second[1], second[0], *second[2:]], *others])


def a_dropped_experiment(run: Path) -> None:
    first, second, *others = batches_of(run)
    write_batches(run, [first, second[1:], *others])


def a_dropped_batch(run: Path) -> None:
    first, _, *others = batches_of(run)
    write_batches(run, [first, *others])


def an_added_batch(run: Path) -> None:
    batches = batches_of(run)
    last = batches[-1][-1]
    trigger = replace(last.trigger, hold_s=0.15)
    write_batches(run, [*batches, [replace(last, trigger=trigger)]])
    for kind in ("records", "proof"):  # with the record of another one
        for path in sorted((run / kind).iterdir()):
            lines = path.read_text().splitlines()
            lines += [
                line.replace(last.id, replace(last, trigger=trigger).id) for line in lines if last.id in line
            ]
            path.write_text("".join(f"{line}\n" for line in lines))


def another_duration(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, trigger=replace(e.trigger, hold_s=0.15)))


def another_value(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, fault=replace(e.fault, value=1.01)))


def another_start(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, trigger=replace(e.trigger, condition="t >= 1.05")))


def another_hold(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, trigger=replace(e.trigger, armed_after_s=0.5)))


def another_seed(run: Path) -> None:
    replace_in_batch(run, 1, 0, lambda e: replace(e, seed=e.seed + 1))


def another_draw_of_the_validation(run: Path) -> None:
    batches = batches_of(run)
    drawn = max(n for n, batch in enumerate(batches) if "~" not in batch[0].fault.spec)
    planned = {e.trigger.hold_s for batch in batches for e in batch}
    hold_s = next(s for s in sorted(filter(None, planned)) if s != batches[drawn][0].trigger.hold_s)
    replace_in_batch(run, drawn, 0, lambda e: replace(e, trigger=replace(e.trigger, hold_s=hold_s)))


def the_end_of_a_run(run: Path) -> None:
    other = {AfterHazard.GO_ON: AfterHazard.STOP, AfterHazard.STOP: AfterHazard.GO_ON}
    replace_in_batch(run, 1, 0, lambda e: replace(e, after_hazard=other[e.after_hazard]))


FORGERIES = (
    a_moved_border,
    a_merged_batch,
    a_split_batch,
    a_reason,
    swapped_batches,
    swapped_experiments,
    a_dropped_experiment,
    a_dropped_batch,
    an_added_batch,
    another_duration,
    another_value,
    another_start,
    another_hold,
    another_seed,
    another_draw_of_the_validation,
    the_end_of_a_run,
)


@pytest.mark.parametrize("forge", FORGERIES, ids=lambda forge: forge.__name__)
def test_a_forged_plan_is_found(
    exploration: Explored, explored_run: Path, reseal: Reseal, forge: Callable[[Path], None]
) -> None:
    """Batches, and what each experiment does, follow from earlier results."""
    check_finds(exploration, explored_run, reseal, forge)


def _edited(experiment: Experiment, rng: random.Random) -> Experiment:
    """Return the experiment with something else, of all that decides its run."""
    fault, trigger = experiment.fault, experiment.trigger
    [injection] = fault.injections
    params = dict(injection.params)
    name = rng.choice([name for name in params if name != "target"])
    changed = "noise" if name == "shape" and params[name] != "noise" else "ramp"
    value = params[name]
    params[name] = changed if isinstance(value, str) else (value or 0) * rng.choice((0.5, 1.001, -1)) + 1e-3
    injections = (
        replace(injection, params=tuple(params.items())),
        replace(injection, params=tuple(sorted({**dict(injection.params), "target": "other"}.items()))),
        replace(injection, location=replace(injection.location, function="Driver.other")),
        replace(injection, model="stuck"),
        replace(injection, where="t < 2"),
        replace(injection, call=rng.randrange(1, 9)),
        replace(injection, every=rng.randrange(2, 9)),
    )
    return rng.choice(
        (
            *(replace(experiment, fault=replace(fault, injections=(other,))) for other in injections),
            replace(experiment, fault=replace(fault, value=fault.size * 1.01)),
            replace(experiment, fault=replace(fault, unit="km")),
            replace(experiment, fault=replace(fault, hold=Hold.TO_END)),
            replace(experiment, trigger=replace(trigger, hold_s=(trigger.hold_s or 0.0) + 0.01)),
            replace(experiment, trigger=replace(trigger, condition="t >= 1.01")),
            replace(experiment, trigger=replace(trigger, armed_after_s=0.5)),
            replace(experiment, trigger=replace(trigger, name="at 3 s")),
            replace(experiment, seed=experiment.seed + 1),
            replace(experiment, method=Method.RANDOM),
        )
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100))
def test_random_edits_of_experiments_are_found(
    exploration: Explored, explored_run: Path, reseal: Reseal, seed: int
) -> None:
    """Of any experiment, constant or challenging: everything that decides its run is compared."""
    rng = random.Random(seed)

    def forge(run: Path) -> None:
        batches = batches_of(run)
        batch = rng.randrange(len(batches))
        number = rng.randrange(len(batches[batch]))
        replace_in_batch(run, batch, number, lambda experiment: _edited(experiment, rng))

    check_finds(exploration, explored_run, reseal, forge)
