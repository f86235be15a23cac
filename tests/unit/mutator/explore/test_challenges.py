"""Bounds and their challengers, on made-up planes."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import pytest

from mutator.errors import MutatorError
from mutator.explore.cell_results import CellState
from mutator.explore.challengers import (
    challenger_names,
    challenger_of,
    challenging_fault,
    seed_number,
)
from mutator.explore.challenges import next_level
from mutator.explore.envelope import Envelope
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Injection
from tests.unit.mutator.explore.made_envelopes import MADE_PLANE, envelope_of, line

NAMES = tuple(challenger_names(("alternating", "ramp", "noise", "glitch"), 1))
PLANE = replace(MADE_PLANE, challengers=NAMES)
Survives = Callable[[str, float, float], bool]


def challenged(survives: Survives) -> Envelope:
    """Explore a plane: constant errors are survived below 5 m, challengers where `survives` holds."""
    return envelope_of(line, PLANE, challengers=survives)


def lowest_failing(levels: Mapping[int, bool], top: int) -> list[int]:
    """Look at levels as asked, of which those that are true fail; return those looked at."""
    looked: dict[int, bool] = {}
    while (level := next_level(looked, top)) is not None:
        assert level not in looked
        looked[level] = levels[level]
    return list(looked)


@pytest.mark.parametrize(
    ("first_failing", "looked"),
    [(31, [30]), (30, [30, 29]), (24, [30, 29, 28, 26, 22, 24, 23]), (0, [30, 29, 28, 26, 22, 14, 0])],
)
def test_a_bound_goes_down_until_a_size_survives(first_failing: int, looked: list[int]) -> None:
    """By strides that double, then between what survives and what does not."""
    levels = {level: level >= first_failing for level in range(31)}
    assert lowest_failing(levels, 30) == looked


def test_bounds_that_survive_stay() -> None:
    """Each is driven once with each challenger that differs from the constant error, and no other cell is."""
    envelope = challenged(lambda name, magnitude, duration_s: True)
    assert [c.bound.duration_s for c in envelope.challenges] == [None, 0.5, 1.0, 2.0, None]
    assert not any(c.is_lowered or c.challenger for c in envelope.challenges)
    driven = envelope.exploration.challenges.results
    assert {cell for cell, _ in driven} == {c.bound.cell for c in envelope.challenges}
    assert envelope.exploration.is_complete
    assert not any(name == "alternating_5s" and envelope.durations_s[c[1]] <= 5 for c, name in driven)


def test_a_challenger_lowers_what_it_is_not_survived_at() -> None:
    """Alternating errors of 1 m and more end badly after 3 s: one bound is lowered."""
    envelope = challenged(lambda name, m, d: not (name == "alternating_0.5s" and m >= 1.0 and d >= 3.0))
    [always] = [c for c in envelope.challenges if c.is_lowered]
    assert always is envelope.challenged() and envelope.largest_survived() == pytest.approx(3.41)
    assert always.level is not None and envelope.magnitudes[always.level + 1] >= 1.0
    assert (envelope.magnitudes[always.level] or 0) < 1.0 and always.challenger == "alternating_0.5s"
    assert always.failed and always.failed[0] == always.level + 1
    assert always.result and always.result.hazard == "H1"


def test_nothing_may_survive() -> None:
    """The lattice ends: no size survives, and no longest duration."""
    envelope = challenged(lambda name, magnitude, duration_s: name != "noise")
    assert [c.level for c in envelope.challenges] == [None] * 5
    assert {c.challenger for c in envelope.challenges} == {"noise"} and envelope.exploration.is_complete


def test_the_longest_duration_of_the_largest_magnitude_is_challenged() -> None:
    """It goes down to a shorter one."""
    envelope = challenged(lambda name, m, d: m < 40 or d < 0.1)
    longest = envelope.challenged_longest()
    assert longest and longest.is_lowered and longest.level is not None
    assert envelope.durations_s[longest.level] < 0.1 <= envelope.durations_s[longest.level + 1]


def test_a_shorter_challenger_lowers_every_bound_that_includes_it() -> None:
    """Noise of 1 m and more ends badly if it lasts for a second at most: nothing larger is survived for every
    duration, nor for all up to 1 and 2 s.
    """
    envelope = challenged(lambda name, m, d: not (name == "noise" and m >= 1.0 and d <= 1.0))
    assert envelope.exploration.is_complete
    bounds = [c for c in envelope.challenges if not c.bound.is_duration]
    assert len(bounds) == 4 and len({c.level for c in bounds}) == 1
    for challenge in bounds:
        assert challenge.level is not None and challenge.is_lowered and challenge.challenger == "noise"
        assert (
            (envelope.magnitudes[challenge.level] or 0)
            < 1.0
            <= (envelope.magnitudes[challenge.level + 1] or 0)
        )
        assert challenge.failed and envelope.durations_s[challenge.failed[1]] <= 1.0


def test_what_has_no_result_has_not_survived() -> None:
    """A challenger that crashes, or is not decided, lowers a bound, too, and says why."""
    envelope = envelope_of(
        line, PLANE, challengers=lambda name, m, d: m < 2, challenger_state=CellState.DISENGAGED
    )
    challenge = envelope.challenged()
    assert challenge and challenge.is_lowered and challenge.result
    assert challenge.result.state is CellState.DISENGAGED


@pytest.mark.parametrize("magnitudes", [[], PLANE.magnitudes])
def test_without_challengers_or_sizes_nothing_is_challenged(magnitudes: list[float]) -> None:
    plane = replace(PLANE, magnitudes=magnitudes, challengers=() if magnitudes else NAMES)
    envelope = envelope_of(line, plane)
    assert envelope.challenges == [] and envelope.exploration.is_complete


def test_a_cell_is_without_hazard_only_if_all_its_seeds_are() -> None:
    """Each cell has a run for each seed; the hazard of one is the cell's."""
    plane, seeds = replace(MADE_PLANE, seeds=3), set[str]()

    def unlucky(form: str, magnitude: float, duration_s: float) -> bool:
        seeds.add(form)
        return form == "seed_2" and magnitude > 2.0

    envelope = envelope_of(lambda m, d: None, plane, seeds_hit=unlucky)
    assert seeds == {"", "seed_1", "seed_2"}
    assert not envelope.survives(3.0, 1.0) and envelope.survives(1.0, 1.0)
    assert envelope.exploration.map.results[len(envelope.magnitudes) - 1, 11].experiment_id.endswith("seed_2")


def test_names_of_challengers() -> None:
    """Noise has a challenger for each seed, and a wrong name is refused."""
    names = challenger_names(("ramp", "noise"), 3)
    assert names == ["ramp", "noise", "noise_seed_1", "noise_seed_2"]
    assert [seed_number(name) for name in names] == [0, 0, 1, 2]
    assert challenger_of("noise_seed_2") is challenger_of("noise")
    with pytest.raises(MutatorError, match="challenger 'jump'"):
        challenger_of("jump")


def offset_fault(model: str = "offset") -> Fault:
    anchor = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="speed")
    place = FaultLocation(path="car.py", function="read", anchor=anchor)
    params = (("by", -2.0), ("low", 0.0), ("target", "speed"))
    injection = Injection(location=place, model=model, params=params)
    return Fault(
        spec="car/speed/slower",
        module="car",
        fault_type="speed",
        reading="",
        value=2.0,
        unit="m/s",
        aim="",
        injections=(injection,),
    )


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("alternating_0.5s", {"shape": "alternating", "period": 1.0}),
        ("ramp", {"shape": "ramp", "period": 4.0}),
        ("glitch", {"shape": "pulses", "period": 0.5, "width": 0.02}),
        ("noise", {"shape": "noise"}),
    ],
)
def test_a_challenger_has_size_place_and_bounds_of_the_constant_error(
    name: str, expected: dict[str, object]
) -> None:
    fault = offset_fault()
    challenger = challenging_fault(fault, name, duration_s=4.0, step_s=0.01, seed=1)
    assert challenger.spec == f"car/speed/slower~{name}" and challenger.value == fault.value
    [injection] = challenger.injections
    params = dict(injection.params)
    assert isinstance(params.pop("seed"), int)
    assert params == {"by": -2.0, "low": 0.0, "target": "speed", **expected}
    assert injection.location == fault.injections[0].location and injection.model == "waveform"
    other = challenging_fault(fault, name, duration_s=4.0, step_s=0.01, seed=2)
    assert challenger.id != fault.id != other.id


def test_only_a_constant_error_is_challenged() -> None:
    with pytest.raises(MutatorError, match="a challenger of the fault model stuck"):
        challenging_fault(offset_fault("stuck"), "ramp", duration_s=1.0, step_s=0.01, seed=1)
