"""The sentences on a plane, on made-up ones."""

import re
from dataclasses import replace

import pytest

from mutator.explore.cell_results import CellState
from mutator.explore.envelope import Envelope
from mutator.report.plane_sentences import describe_plane, describe_plane_validation
from tests.unit.mutator.explore.made_envelopes import MADE_PLANE, envelope_of, line, never
from tests.unit.mutator.explore.made_planes import LATTICE

NO_VALUE = replace(MADE_PLANE, spec="sensor/silence/no_data", magnitudes=[], unit="")
NEGATIVE = replace(MADE_PLANE, magnitudes=[-value for value in MADE_PLANE.magnitudes])
FINE = replace(MADE_PLANE, magnitudes=list(LATTICE.magnitudes), durations_s=list(LATTICE.durations_s))


def sentence(envelope: Envelope) -> str:
    return describe_plane(envelope, {"H1": "The car touches the vehicle ahead."})


def holes(magnitude: float, duration_s: float) -> float | None:
    """Hazards of single magnitudes, most of which only drawn cells can meet."""
    return 20.0 if int(magnitude * 7 + 1) % 11 == 0 and 0.3 < duration_s < 2.0 else None


def test_the_sentence_says_where_it_fails_and_what_was_driven() -> None:
    """With units, start, scenario, hazard and time; cells that were not driven are not called tried."""
    text = sentence(envelope_of(line))
    assert text.startswith("No hazard of sensor/bias/distance of up to 3.41 m was found in A from 5 s, for ")
    assert "; it first fails at 5 m for 1." in text
    assert "(H1, the car touches the vehicle ahead, after 2.00 s). " in text
    assert re.search(r"\. \d+ of 156 cells were driven, the others are inferred or between runs; of", text)
    assert re.search(
        r"of the 72 cells that the search left undriven .*, at most 23 of these 72 \(32 %\)", text
    )
    assert text.endswith(" are hazardous (95 %, for all validations of this plane together).")
    assert "tried" not in text


@pytest.mark.parametrize(
    ("envelope", "text"),
    [
        (
            envelope_of(never),
            "No hazard of sensor/bias/distance of up to 50 m was found in A from 5 s, for ",
        ),
        (envelope_of(never, validation=0), " cells were driven; the others were not validated."),
        (
            envelope_of(lambda m, d: 1.0),
            "Not even the smallest magnitude of sensor/bias/distance in A from",
        ),
        (envelope_of(never, most_runs=5), "in A from 5 s is not decided: 151 cells neither driven nor"),
        (envelope_of(lambda m, d: 2.0 if d >= 1 else None, NO_VALUE), "found in A from 5 s for up to 0."),
        (envelope_of(lambda m, d: 2.0, NO_VALUE), "called without hazard; it first fails at 0.01 s"),
        (envelope_of(never, NO_VALUE), "12 of 12 cells were driven, among them each that is called without"),
        (envelope_of(line, NEGATIVE), "(negative) of up to -3.41 m"),
    ],
)
def test_the_sentence_fits_each_kind_of_plane(envelope: Envelope, text: str) -> None:
    """Without hazards, with nothing survived, cut off, without values, with negative ones."""
    assert text in sentence(envelope)


def test_an_inferred_failure_names_its_run() -> None:
    """The shortest fault that fails was not driven: a longer one shows that it does."""
    text = sentence(envelope_of(lambda m, d: 0.6 if m >= 5 and d >= 3 else None))
    assert re.search(r"first fails at 5 m for 0\.81 s \(inferred from run \(6, \d+\): H1, .* 0\.60 s\)", text)


def test_crashed_runs_leave_a_plane_undecided() -> None:
    """Without a result, no hazard can be excluded; a hazard elsewhere does not hide that."""
    text = sentence(envelope_of(never, crashes=lambda m, d: m > 20))
    assert re.search(r"is not decided: \d+ runs have no result \(the first: ValueError: no lead\)\.", text)
    assert "No hazard" not in text
    assert "Not decided: " in sentence(envelope_of(line, crashes=lambda m, d: m > 20))


def test_a_controller_that_ends_disengaged_is_counted_apart() -> None:
    """It has not survived, which ends what is survived, but no hazard is claimed."""
    envelope = envelope_of(never, crashes=lambda m, d: m > 20, without_result=CellState.DISENGAGED)
    text = sentence(envelope)
    assert re.match(
        r"No hazard of sensor/bias/distance of up to 1\d\.?\d* m was found in A from 5 s, for", text
    )
    assert re.search(r"\d+ runs without a hazard ended with the controller disengaged or crashed \(", text)
    assert "first fails" not in text and not envelope.survives(25.0, 0.1) and envelope.survives(10.0, 1.0)
    assert {"d", "o"} <= set("".join(envelope.as_json()["cells"]))
    assert "d" not in "".join(envelope_of(never).as_json()["cells"])


def test_a_fault_that_was_never_active_shows_nothing() -> None:
    """Runs that equal the golden run are no evidence."""
    envelope = envelope_of(never)
    results = envelope.exploration.map.results
    results.update({cell: replace(result, is_activated=False) for cell, result in results.items()})
    text = sentence(envelope)
    assert "is not decided: the fault was never active." in text and "No hazard" not in text


def test_an_unfinished_validation_says_so() -> None:
    """A cell that was drawn but not driven shows nothing."""
    whole = envelope_of(line)
    cut = envelope_of(line, most_runs=whole.run_count - 3)
    text = describe_plane_validation(cut)
    assert text == "Validation unfinished: 7 of 10 drawn cells driven, 0 of them hazardous."
    assert "the validation of the others is unfinished" in sentence(cut)


def test_the_validation_says_what_follows() -> None:
    """The share that can be hazardous, with its level; or that every cell was driven."""
    text = describe_plane_validation(envelope_of(line, validation=10))
    assert re.fullmatch(
        r"The search left 72 cells undriven that it calls without hazard\. 10 cells drawn from them: 0 "
        r"hazardous\. So at most 23 of these 72 \(32 %\) are hazardous \(95 %, for all validations of .*\)\.",
        text,
    )
    assert describe_plane_validation(envelope_of(never, validation=0)) == "Not validated."
    assert "All were drawn: 0 of" in describe_plane_validation(envelope_of(never, validation=1000))
    assert "Nothing to validate" in describe_plane_validation(envelope_of(never, NO_VALUE))


def test_earlier_looks_are_shown() -> None:
    """What repairs followed on is not hidden by the last look."""
    text = describe_plane_validation(envelope_of(holes, FINE, validation=86))
    assert "86 cells drawn from them: 0 hazardous. So at most 8" in text and "(4.9 %)" in text
    assert text.endswith(" 1 look before found 1 hazardous cell, whose line was then searched.")


CHALLENGED = replace(MADE_PLANE, challengers=("alternating_0.5s", "noise"))


def test_a_bound_that_survives_challengers_is_of_changing_errors_too() -> None:
    text = sentence(envelope_of(line, CHALLENGED))
    assert text.startswith(
        "No hazard of sensor/bias/distance of up to 3.41 m, constant or changing, was found in A from 5 s"
    )


def test_the_sentence_says_what_a_challenger_lowered() -> None:
    """The size that survives, that of the constant error, and the run that shows the difference."""
    envelope = envelope_of(line, CHALLENGED, challengers=lambda name, m, d: name == "noise" or m < 1.5)
    text = sentence(envelope)
    assert re.match(r"No hazard of sensor/bias/distance of up to 1\.\d+ m, constant or changing, was", text)
    assert re.search(r"\(3\.41 m for 10 s is survived if constant, but [\d.]+ m for 10 s, changing its", text)
    assert "sign every 0.5 s, is not (H1, run (" in text and "survives all)" in text
    none = envelope_of(line, CHALLENGED, challengers=lambda name, m, d: False)
    assert sentence(none).startswith(
        "Not even the smallest magnitude of sensor/bias/distance in A from 5 s sur"
    )


def test_the_sentence_says_how_many_seeds_a_cell_has() -> None:
    text = sentence(envelope_of(line, replace(MADE_PLANE, seeds=3)))
    assert " cells were driven, each with 3 seeds" in text
