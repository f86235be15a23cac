"""Severity and metrics in the comparison of two runs."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.comparison.comparison_files import pair_cells, summary_text
from mutator.comparison.experiment_matching import ResultChangeKind
from mutator.comparison.run_comparison_and_gates import Comparison, Gate, compare_runs, findings_of_gates
from mutator.errors import MutatorError
from mutator.model import Experiment, Method, Outcome
from mutator.workspace import Workspace

MANIFEST = """\
hazards: {H1: {about: contact, when: gap <= 0, terminal: true}, H3: {}, TOO_FAST: {}}
metrics:
  closing: {at_end: speed, unit: m/s, worse: higher, about: x}
  way: {integral: speed, unit: m, worse: lower, about: x}
severity: {contact: H1, contact_speed: closing, mass_kg: 1000, other_mass_kg: 1000, scale: hard}
"""
SCALE = """\
schema: severity/1
source: x
classes:
  S0: {from_kph: 0, about: a}
  S1: {from_kph: 3.6, about: b}
  S2: {from_kph: S2_FROM, about: c}
  S3: {from_kph: 36, about: d}
"""


def contact(delta_v: float, **more: float) -> dict[str, Any]:
    metrics = ({"closing": 2 * delta_v, "way": 10.0, "delta_v": delta_v} | more).items()
    return {
        "outcome": Outcome.HAZARD,
        "t_manifest": 2.5,
        "t_end": 4.0,
        "hazards": (("H1", 4.0),),
        "metrics": tuple(metrics),
    }


def before(e: Experiment) -> dict[str, Any]:
    return contact(2.0) if e.fault.fault_type == "lane" else {"metrics": (("way", 20.0),)}


def after(e: Experiment) -> dict[str, Any]:
    if e.fault.fault_type == "lane":
        return contact(12.0) if e.method is Method.GUIDED else {"metrics": (("way", 30.0),)}
    return contact(5.0, way=16.0) if e.fault.fault_type == "distance" else {"metrics": (("way", 20.0),)}


@pytest.fixture(scope="module")
def runs(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> tuple[Path, ...]:
    """The runs `before`, `after`, `strict` (`before` with another severity scale) and `without` (no
    severity)."""
    place = tmp_path_factory.mktemp("runs")
    toycar = copy_toycar(place)
    without = write_run(toycar, place / "without")
    manifest, scale = toycar.targets["toycar"], toycar.library / "severity" / "hard.yaml"
    text = manifest.read_text()
    manifest.write_text(text.replace("hazards: [H1, H3, TOO_FAST]\n", MANIFEST))
    scale.parent.mkdir()
    scale.write_text(SCALE.replace("S2_FROM", "18"))
    made = write_run(toycar, place / "before", before), write_run(toycar, place / "after", after)
    scale.write_text(SCALE.replace("S2_FROM", "5"))
    return *made, write_run(toycar, place / "strict", before), without


@pytest.fixture(scope="module")
def found(runs: tuple[Path, ...]) -> Comparison:
    return compare_runs(runs[0], runs[1])


def kinds(found: Comparison, change: ResultChangeKind) -> set[tuple[str, str]]:
    pairs = found.pairs_with_change(change)
    return {(p.b.fault.fault_type, f"{p.row_a.severity}>{p.row_b.severity}") for p in pairs}


def test_each_change_of_severity_is_listed(found: Comparison) -> None:
    assert kinds(found, ResultChangeKind.HIGHER_SEVERITY) == {("lane", "S1>S3"), ("distance", ">S2")}
    assert kinds(found, ResultChangeKind.LOWER_SEVERITY) == {("lane", "S1>")}
    assert "higher-severity" in summary_text(found)
    line = pair_cells(found.pairs_with_change(ResultChangeKind.HIGHER_SEVERITY)[0])
    assert (line["delta_v_b"], line["severity_b"]) in {(12.0, "S3"), (5.0, "S2")}


def test_a_gate_finds_new_and_more_severe_contacts(found: Comparison) -> None:
    counts = {
        gate: len(findings_of_gates(found, [gate])) for gate in Gate if gate.value.startswith("severity:")
    }
    distance = sum(p.b.fault.fault_type == "distance" for p in found.pairs)
    harder = sum(p.b.fault.fault_type == "lane" and p.b.method is Method.GUIDED for p in found.pairs)
    assert 0 < harder < distance + harder
    assert list(counts.values()) == [distance, distance, distance + harder, harder]
    severe = findings_of_gates(found, [Gate.SEVERITY_S2])
    assert any("c (severity S2), delta-v 5.00 m/s" in finding.description for finding in severe)
    assert len(findings_of_gates(found, [Gate.HIGHER_SEVERITY])) == distance + harder


def test_the_medians_of_metrics_are_compared(found: Comparison) -> None:
    sheets = {sheet.name: sheet for sheet in found.sheets}
    lines = [dict(zip(sheets["metrics"].heads, line, strict=True)) for line in sheets["metrics"].lines]
    way = next(line for line in lines if line["metric"] == "way")
    assert (way["pairs"], way["unit"], way["worse"]) == (len(found.pairs), "m", "lower")
    by_type = {
        line[1]: dict(zip(sheets["metrics_by_fault_type"].heads, line, strict=True))
        for line in sheets["metrics_by_fault_type"].lines
        if line[0] == "way"
    }
    told = {kind: (line["before"], line["after"], line["difference"]) for kind, line in by_type.items()}
    assert told["sensor/distance"] == (20.0, 16.0, -4.0)
    assert told["sensor/silence"] == (20.0, 20.0, 0.0)


def test_the_table_of_severity_classes_contains_each_pair_once(found: Comparison) -> None:
    sheet = next(sheet for sheet in found.sheets if sheet.name == "severity")
    assert sheet.heads == ("before / after", "S3", "S2", "S1", "no class")
    assert sum(sum(line[1:]) for line in sheet.lines) == len(found.pairs)  # type: ignore[arg-type]


def test_the_scale_of_the_second_run_applies_to_both_runs(runs: tuple[Path, ...]) -> None:
    found = compare_runs(runs[0], runs[2])
    assert found.changed_pairs == ()
    assert {p.row_a.severity for p in found.pairs} == {"", "S2"}
    assert found.remarks[-1] == "The runs have different severity scales; only that of strict is used."
    assert [fact.name for fact in found.facts if fact.is_different] == ["scale of severity"]


@pytest.mark.parametrize("order", [(0, 3), (3, 0)])
def test_without_severity_classes_no_change_of_severity_is_reported(
    runs: tuple[Path, ...], order: tuple[int, int]
) -> None:
    found = compare_runs(*(runs[i] for i in order))
    assert not found.pairs_with_change(ResultChangeKind.HIGHER_SEVERITY) + found.pairs_with_change(
        ResultChangeKind.LOWER_SEVERITY
    )
    assert "Severity is not compared: without has no severity classes." in found.remarks
    with pytest.raises(MutatorError, match="without has no severity classes"):
        findings_of_gates(found, [Gate.SEVERITY_S1])
