"""The sentences and the table of a report's envelopes, on made-up planes."""

from dataclasses import replace

from mutator.explore.cell_results import CellState
from mutator.explore.envelope import Envelope
from mutator.report.explored_planes import NO_BREAK, ExploredPlanes
from mutator.report.panels.envelopes_panel import panel_of_planes
from tests.unit.mutator.explore.made_envelopes import MADE_PLANE, envelope_of, line, never

NO_VALUE = replace(MADE_PLANE, spec="sensor/silence/no_data", magnitudes=[], unit="")


def row(envelope: Envelope, *, with_links: bool = False) -> dict[str, str]:
    table = ExploredPlanes.of_envelopes([envelope], {}).table(with_links=with_links)
    return dict(zip(table.heads, table.rows[0], strict=True))


def test_the_worst_plane_comes_first() -> None:
    """Planes of one fault stay together; the fault with the worst plane comes first."""
    worse = envelope_of(lambda m, d: 1.0, replace(MADE_PLANE, scenario="B"))
    safe = envelope_of(never, replace(MADE_PLANE, spec="other/bias/speed"))
    planes = ExploredPlanes.of_envelopes([safe, envelope_of(line), worse], {})
    scenarios = [(envelope.plane.spec, envelope.plane.scenario) for envelope in planes.envelopes]
    assert scenarios == [(MADE_PLANE.spec, "B"), (MADE_PLANE.spec, "A"), ("other/bias/speed", "A")]
    assert planes.describe_all() == (
        "That is the first of 3 planes, by their share of hazardous cells; in 1 of them no hazard was found."
    )


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
    cell = row(envelope, with_links=True)["survived up to"]
    planes = ExploredPlanes.of_envelopes([envelope], {})
    pair = envelope.boundary_pair(len(envelope.magnitudes) - 1)
    assert pair and pair.hazardous.experiment_id in planes.linked_ids
    assert cell.startswith('<a href="#e=') and "&amp;with=" in cell


def test_undecided_planes_are_not_called_free_of_hazards() -> None:
    """A plane whose runs crash comes before one that is decided, and counts for neither side."""
    safe = envelope_of(never, replace(MADE_PLANE, spec="a/bias/speed"))
    crashed = envelope_of(never, crashes=lambda m, d: m > 20)
    planes = ExploredPlanes.of_envelopes([safe, crashed], {})
    assert planes.envelopes[0] is crashed and "is not decided" in planes.first_sentence()
    text = "in 1 of them no hazard was found, 1 of them cannot be decided."
    assert planes.describe_all().endswith(text)
    both = ExploredPlanes.of_envelopes([safe, envelope_of(never)], {}).describe_all()
    assert both == "No hazard was found in any of the 2 planes."


def test_the_table_has_a_bound_before_and_after_its_challengers() -> None:
    """With the challenger, what follows, and a link to its run; a fault without a size is not challenged."""
    plane = replace(MADE_PLANE, challengers=("alternating_0.5s",))
    lowered = envelope_of(line, plane, challengers=lambda name, m, d: m < 1.5 or d < 1.5)
    cells = row(lowered, with_links=True)
    bound = cells["survived for every duration"].replace(NO_BREAK, " ")
    assert bound.endswith(" m (3.41 m if constant)</a>")
    assert cells["for 0.5 s"] == "50 m" and cells["challengers lowered"] == "3 of 5 bounds"
    planes = ExploredPlanes.of_envelopes([lowered, envelope_of(line, NO_VALUE)], {})
    [first, *_] = planes.challenges_table(with_links=False).rows
    assert first[3] == "3.41 m for 10 s" and first[6:] == ["changing its sign every 0.5 s", "H1 after 3.00 s"]
    challenge = lowered.challenged()
    assert challenge and challenge.result and challenge.result.experiment_id in planes.linked_ids
    assert row(envelope_of(line, NO_VALUE))["challengers lowered"] == "not challenged"
    panel = panel_of_planes(planes)
    assert "What challengers lowered" in panel.html and "What challengers lowered" in panel.markdown


def test_unfinished_challenges_lower_nothing() -> None:
    """Cut off after any number of runs, table and sentence are of constant errors until all is driven."""
    plane = replace(MADE_PLANE, challengers=("noise", "ramp"))
    whole = envelope_of(line, plane, challengers=lambda name, m, d: m < 1.5)
    challenges = whole.exploration.challenges.results
    assert len(challenges) > 8
    begin = whole.run_count
    for count in range(begin, begin + len(challenges)):
        cut = envelope_of(line, plane, most_runs=count, challengers=lambda name, m, d: m < 1.5)
        planes = ExploredPlanes.of_envelopes([cut], {})
        assert row(cut)["challengers lowered"] == "unfinished" and planes.first_sentence()
        assert all(c.is_complete for c in cut.challenges if c.is_lowered) and planes.linked_ids
        panel_of_planes(planes)


def test_a_fault_after_which_nobody_drives_is_not_survived() -> None:
    """No hazard followed, but the controller ended disengaged: so says the table."""
    envelope = envelope_of(never, NO_VALUE, crashes=lambda m, d: d > 0.3, without_result=CellState.DISENGAGED)
    assert row(envelope)["for 1 s"] == "no" and row(envelope)["survived for every duration"] == "no"
    planes = ExploredPlanes.of_envelopes([envelope, envelope_of(line)], {})
    assert planes.describe_all().endswith("in 1 the controller only ended disengaged or crashed.")


def test_the_page_says_what_was_driven_and_that_nothing_else_was() -> None:
    text = ExploredPlanes.of_envelopes([envelope_of(line)], {}).describe_scope()
    assert text.startswith(
        "Driven: 1 fault, one at a time, in A, from 5 s on, for up to 10 s, and observed for "
    )
    assert "Nothing is said of other faults" in text and "challenger" not in text
    assert ExploredPlanes(envelopes=()).describe_scope() == ""
