"""The sentences and the table of a report's envelopes, on made-up planes."""

import re
from dataclasses import replace

import pytest

from mutator.explore.envelope import Envelope
from mutator.report.explored_planes import ExploredPlanes, describe_plane_validation
from tests.unit.mutator.explore.made_envelopes import MADE_PLANE, envelope_of, line, never

NO_VALUE = replace(MADE_PLANE, spec="sensor/silence/no_data", magnitudes=[], unit="")
NEGATIVE = replace(MADE_PLANE, magnitudes=[-value for value in MADE_PLANE.magnitudes])


def sentence(*envelopes: Envelope) -> str:
    return ExploredPlanes.of_envelopes(
        envelopes, {"H1": "The car touches the vehicle ahead."}
    ).first_sentence()


def row(envelope: Envelope, *, with_links: bool = False) -> dict[str, str]:
    table = ExploredPlanes.of_envelopes([envelope], {}).table(with_links=with_links)
    return dict(zip(table.heads, table.rows[0], strict=True))


def test_the_first_sentence_says_what_is_survived_and_where_it_fails() -> None:
    """With units, start, scenario, hazard and time."""
    text = sentence(envelope_of(line))
    assert text.startswith(
        "The controller survives sensor/bias/distance of up to 3.41 m in A from 5 s for every"
    )
    assert "; it first fails at 5 m for 1." in text
    assert text.endswith("(H1, the car touches the vehicle ahead, after 2.00 s).")


@pytest.mark.parametrize(
    ("envelope", "text"),
    [
        (envelope_of(never), "of up to 50 m in A from 5 s for every duration tried, up to 10 s."),
        (envelope_of(lambda m, d: 1.0), "survives no magnitude tried of sensor/bias/distance in A from 5 s"),
        (envelope_of(never, most_runs=5), "was found in A from 5 s, but not all of its cells are decided."),
        (envelope_of(lambda m, d: 2.0 if d >= 1 else None, NO_VALUE), "no_data in A from 5 s for up to 0."),
        (envelope_of(lambda m, d: 2.0, NO_VALUE), "for no duration tried; it first fails at 0.01 s"),
        (envelope_of(never, NO_VALUE), "survives sensor/silence/no_data in A from 5 s for every duration"),
        (envelope_of(line, NEGATIVE), "(negative) of up to -3.41 m"),
    ],
)
def test_the_sentence_fits_each_kind_of_plane(envelope: Envelope, text: str) -> None:
    """Without hazards, with nothing survived, cut off, without values, with negative ones."""
    assert text in sentence(envelope)


def test_an_unfinished_validation_says_so() -> None:
    """A cell that was drawn but not driven shows nothing."""
    whole = envelope_of(line)
    text = describe_plane_validation(envelope_of(line, most_runs=whole.run_count - 3))
    assert text == "Validation unfinished: 7 of 10 drawn cells driven, 0 of them hazardous."


def test_the_worst_plane_comes_first() -> None:
    """Planes of one fault stay together; the fault with the worst plane comes first."""
    worse = envelope_of(lambda m, d: 1.0, replace(MADE_PLANE, scenario="B"))
    safe = envelope_of(never, replace(MADE_PLANE, spec="other/bias/speed"))
    planes = ExploredPlanes.of_envelopes([safe, envelope_of(line), worse], {})
    scenarios = [(envelope.plane.spec, envelope.plane.scenario) for envelope in planes.envelopes]
    assert scenarios == [(MADE_PLANE.spec, "B"), (MADE_PLANE.spec, "A"), ("other/bias/speed", "A")]
    assert planes.describe_all() == "That is the worst of 3 planes; in 1 of them no hazard was found."


def test_a_row_answers_for_each_duration() -> None:
    """5 m are survived for half a second, not for one."""
    cells = row(envelope_of(line))
    assert (cells["survived for every duration"], cells["for 0.5 s"], cells["for 1 s"]) == (
        "3.41 m",
        "50 m",
        "3.41 m",
    )
    assert (cells["largest tried"], cells["hazard after"]) == ("50 m", "2.00 s")
    assert row(envelope_of(never, NO_VALUE))["for 1 s"] == "yes"
    assert row(envelope_of(lambda m, d: 2.0 if d > 1 else None, NO_VALUE))["for 2 s"] == "no"


def test_a_duration_beyond_the_lattice_is_not_tried() -> None:
    """It must not count as survived."""
    short = replace(MADE_PLANE, durations_s=[0.01, 0.1, 0.6])
    cells = row(envelope_of(never, short))
    assert (cells["for 0.5 s"], cells["for 1 s"]) == ("50 m", "not tried")


def test_links_open_a_pair_of_runs() -> None:
    """The run with the hazard, with its neighbour beside it; the list has both."""
    envelope = envelope_of(line)
    cell = row(envelope, with_links=True)["up to"]
    planes = ExploredPlanes.of_envelopes([envelope], {})
    pair = envelope.boundary_pair(len(envelope.magnitudes) - 1)
    assert pair and pair.hazardous.experiment_id in planes.linked_ids
    assert cell.startswith('<a href="#e=') and "&amp;with=" in cell


def test_the_validation_says_what_follows() -> None:
    """The share that can be hazardous, with its level; or that every cell was driven."""
    text = describe_plane_validation(envelope_of(line, validation=10))
    assert re.fullmatch(
        r"0 of 10 drawn cells hazardous: at most \d+ % of the cells called without hazard are hazardous "
        r"\(98\.75 % for each look\)\.",
        text,
    )
    assert describe_plane_validation(envelope_of(never, validation=0)) == "Not validated."
    assert "these are all" in describe_plane_validation(envelope_of(never, validation=1000))
    assert "Nothing to validate" in describe_plane_validation(envelope_of(never, NO_VALUE))
