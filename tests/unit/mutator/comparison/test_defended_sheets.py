"""The tables of sets of defences that need metrics of the target."""

from types import SimpleNamespace
from typing import Any

from mutator.comparison.defended_pairs import DefendedPair, PairOutcome, pair_of
from mutator.comparison.defended_sets import DefendedSet
from mutator.comparison.defended_sheets import defence_sheets
from mutator.model import Status
from mutator.statistics.statistics_sheet import Sheet
from mutator.targets.stored_target_facts import MetricFacts

from .test_defended_pairs import H1, H2, OBSERVE_S, OVER, facts, row

METRICS = {
    "smallest_gap": "m",
    "smallest_ttc": "s",
    "margin_h1": "m",
    "contact_speed": "m/s",
    "delta_v": "m/s",
}


def pair(name: str, before: Any, after: Any, **more: Any) -> DefendedPair:
    return pair_of(before, after, facts(**OVER | more), OBSERVE_S)


def side(metrics: dict[str, str], by_id: dict[str, Any], rows: list[Any], contact: str) -> Any:
    head = SimpleNamespace(
        metrics=[MetricFacts(name, unit, "", "lower") for name, unit in metrics.items()],
        severity=SimpleNamespace(contact=contact) if contact else None,
    )
    return SimpleNamespace(
        stratum_by_id=None,
        folder=SimpleNamespace(head=head),
        metrics_by_id=by_id,
        experiments=[SimpleNamespace(id=row.experiment_id) for row in rows],
        row_by_id={row.experiment_id: row for row in rows},
    )


def sheets_of(metrics: dict[str, str], contact: str = "H1") -> dict[str, Sheet]:
    """Four experiments: a contact that gets slower, one that is prevented, one that is caused, and a needless
    activation.
    """
    rows = {
        "slower": (row(H1, experiment_id="slower", delta_v=5.0), row(H1, delta_v=2.0)),
        "prevented": (row(H1, experiment_id="prevented", delta_v=4.0), row(())),
        "caused": (row((), experiment_id="caused"), row(H1, delta_v=1.0)),
        "needless": (row((), experiment_id="needless", margins=(("H1", 3.0),)), row(())),
    }
    before = {
        "slower": {"contact_speed": 10.0},
        "prevented": {"contact_speed": 8.0},
        "needless": {"smallest_gap": 6.5, "smallest_ttc": 2.5},
    }
    after = {"slower": {"contact_speed": 4.0}, "caused": {"contact_speed": 2.0}}
    of_set = DefendedSet(
        name="brake",
        undefended=side(metrics, before, [first for first, _ in rows.values()], contact),
        defended=side(metrics, after, [], contact),
        pairs=tuple(pair(name, *both, first_acted_s=1.5) for name, both in rows.items()),
        golden_activities=(),
        caused_goldens=(),
    )
    return {sheet.name: sheet for sheet in defence_sheets([of_set], ["H1", "H2"])}


def test_contacts_are_compared_by_their_speed() -> None:
    """Speeds are of the contacts without and of those that remain; a caused one is counted apart."""
    sheet = sheets_of(METRICS)["defended_contacts"]
    (line,) = sheet.lines
    assert dict(zip(sheet.heads, line, strict=True)) == {
        "defences": "brake",
        "contacts": 2,
        "contacts with defences": 1,
        "others": 1,
        "median speed (m/s)": 9.0,
        "median speed, with (m/s)": 4.0,
        "largest speed (m/s)": 10.0,
        "largest speed, with (m/s)": 4.0,
        "change of delta-v, median (m/s)": -3.0,
        "change of delta-v, most (m/s)": -3.0,
    }


def test_a_target_without_such_metrics_lacks_their_columns() -> None:
    sheet = sheets_of({})["defended_contacts"]
    assert sheet.heads == ("defences", "contacts", "contacts with defences", "others")
    assert sheets_of(METRICS, contact="")["defended_contacts"].lines == ()
    heads = sheets_of({})["unneeded_activations"].heads
    assert heads == ("defences", "experiment", "fault", "scenario", "acted", "first at (s)", "margin H1")


def test_unneeded_activations_say_how_close_the_undefended_run_came() -> None:
    """Also those that cause a hazard; metrics without a value have empty cells."""
    sheet = sheets_of(METRICS)["unneeded_activations"]
    assert sheet.heads[5:] == ("first at (s)", "smallest gap (m)", "smallest TTC (s)", "margin H1 (m)")
    cells = {line[1]: line[5:] for line in sheet.lines}
    assert cells == {"caused": (1.5, None, None, None), "needless": (1.5, 6.5, 2.5, 3.0)}


def test_a_table_has_a_column_for_each_set() -> None:
    """With what became of each experiment."""
    sheet = sheets_of(METRICS)["defended_experiments"]
    assert sheet.heads[-2:] == ("undefended", "with brake")
    assert [(line[0], *line[-2:]) for line in sheet.lines] == [
        ("slower", "H1", "mitigated"),
        ("prevented", "H1", "prevented"),
        ("caused", "none", "caused H1"),
        ("needless", "none", "no hazard"),
    ]


def test_an_outcome_in_words_names_other_hazards() -> None:
    crashed = row((), status=Status.CRASHED, outcome=None)
    pairs = [pair("", row(H1), row(H2)), pair("", row(()), row(H2)), pair("", row(H1), crashed)]
    assert [each.what_became for each in pairs] == ["replaced by H2", "caused H2", "not compared"]
    assert {outcome.words for outcome in PairOutcome} >= {"no hazard", "not compared", "open"}
