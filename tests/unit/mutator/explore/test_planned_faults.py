"""The faults of a plan are those that their names say."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest

from mutator.explore.challengers import challenging_fault
from mutator.explore.planned_faults import PlannedFaults
from mutator.model import Experiment, Fault, Hold, Method
from mutator.triggers.trigger_kinds import trigger_at_time
from tests.unit.mutator.explore.test_challenges import offset_fault

FACTOR = 3.6 / 1.609344  # of units, not exact


def fault_of_size(value: float) -> Fault:
    """A constant error, in another unit than its value, with a bound that every size has."""
    fault = offset_fault()
    params = (("by", -value * FACTOR), ("low", 0.5), ("target", "speed"))
    return replace(fault, value=value, injections=(replace(fault.injections[0], params=params),))


def experiment_of(fault: Fault) -> Experiment:
    return Experiment(
        fault=fault,
        scenario="S1",
        scenario_digest="",
        method=Method.GUIDED,
        trigger=trigger_at_time(1.0, hold_s=4.0),
        seed=1,
    )


def challenger(value: float, name: str) -> Fault:
    return challenging_fault(fault_of_size(value), name, duration_s=4.0, step_s=0.01, seed=1)


def wrong_positions(faults: Sequence[Fault]) -> list[int]:
    planned = PlannedFaults(0.01)
    for position, fault in enumerate(faults):
        planned.note(position, experiment_of(fault))
    return sorted(planned.wrong_positions())


def with_params(fault: Fault, **values: object) -> Fault:
    params = tuple(sorted({**dict(fault.injections[0].params), **values}.items()))
    return replace(fault, injections=(replace(fault.injections[0], params=params),))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["alternating_0.5s", "ramp", "noise", "glitch", "noise_seed_2"])
def test_challengers_follow_from_constant_errors(name: str) -> None:
    """Also from one of another size, from a single one, and with the other sign."""
    assert wrong_positions([fault_of_size(2.0), challenger(2.0, name)]) == []
    assert wrong_positions([fault_of_size(3.0), challenger(7.0, name)]) == []
    assert wrong_positions([*map(fault_of_size, (0.1, -3.3)), challenger(7.0, name)]) == []


@pytest.mark.parametrize(
    "forge",
    [
        lambda fault: with_params(fault, by=-1.0),
        lambda fault: with_params(fault, by=7.0 * FACTOR),
        lambda fault: with_params(fault, low=0.0),
        lambda fault: with_params(fault, seed=3),
        lambda fault: with_params(fault, period=1e6),
        lambda fault: replace(fault, value=8.0),
        lambda fault: replace(fault, spec="car/speed/slower~ramp_2"),
        lambda fault: replace(fault, spec="car/other~ramp"),
        lambda fault: replace(fault, changes=("alone",)),
        lambda fault: replace(fault, hold=Hold.TO_END),
        lambda fault: replace(fault, injections=()),
        lambda fault: replace(fault, injections=fault.injections * 2),
        lambda fault: with_params(fault, by="7"),
    ],
)
@pytest.mark.parametrize("driven", [(2.0, 3.0), (2.0, 7.0)])
def test_an_edited_challenger_is_wrong(forge: Callable[[Fault], Fault], driven: Sequence[float]) -> None:
    """Whether the constant error of its size was driven or not."""
    edited = forge(challenger(7.0, "ramp"))
    assert wrong_positions([*map(fault_of_size, driven), edited]) == [2]


def test_an_edited_constant_error_does_not_excuse_its_challenger() -> None:
    """Its size is not in proportion to that of the others."""
    edited = with_params(fault_of_size(7.0), by=-0.001)
    weak = challenging_fault(edited, "ramp", duration_s=4.0, step_s=0.01, seed=1)
    assert wrong_positions([*map(fault_of_size, (2.0, 3.0)), edited, weak]) != []
    assert wrong_positions([edited, *map(fault_of_size, (2.0, 3.0)), weak]) != []


def test_sizes_that_do_not_grow_with_the_value_are_wrong() -> None:
    """All challenged errors of a variant have the same size, whatever their names say."""
    small = [with_params(fault_of_size(value), by=0.001) for value in (2.0, 3.0, 7.0)]
    weak = challenging_fault(small[-1], "ramp", duration_s=4.0, step_s=0.01, seed=1)
    assert wrong_positions([*small, weak]) == [1, 2]


def test_the_same_value_is_the_same_fault() -> None:
    """Also of faults that are not challenged, whose sizes need not be in proportion to their values."""
    other = offset_fault("stuck")
    assert wrong_positions([other, replace(other, value=4.0)]) == []
    assert wrong_positions([other, with_params(other, by=3.0)]) == [1]
    elsewhere = replace(other.injections[0], call=1)
    assert wrong_positions([other, replace(other, value=4.0, injections=(elsewhere,))]) == [1]
