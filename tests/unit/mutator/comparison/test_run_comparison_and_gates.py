"""Compare two run folders, and write the comparison."""

import csv
import shutil
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from mutator.comparison import comparison_files
from mutator.comparison.compared_runs import load_compared_run
from mutator.comparison.input_differences_and_remarks import differing_pairs_remarks, input_facts
from mutator.comparison.run_comparison_and_gates import Comparison, Gate, compare_runs, findings_of_gates
from mutator.errors import CheckFailed, MutatorError
from mutator.model import AfterHazard, Experiment, Outcome, Status
from mutator.store.session_environments import SessionEnvironment
from mutator.workspace import Workspace
from tests.unit.mutator.explore.made_envelopes import envelope_of, never

Write = Callable[..., Path]
HAZARD = {"outcome": Outcome.HAZARD, "t_manifest": 2.5, "hazards": (("H3", 4.0),)}


def lane_is_left(e: Experiment) -> dict[str, Any]:
    if e.fault.fault_type != "lane":
        return {}
    if e.fault.value == 0.8:
        return {"status": Status.CRASHED, "outcome": None, "detail": "a <b>crash</b>"}
    return HAZARD


@pytest.fixture(scope="module")
def runs(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace], write_run: Write
) -> tuple[Path, Path]:
    """The runs `before`, in which every fault is masked, and `after`, with a changed target and worse
    results."""
    place = tmp_path_factory.mktemp("runs")
    toycar = copy_toycar(place)
    before = write_run(toycar, place / "before")
    driver = toycar.library.parent / "tree" / "toycar" / "driver.py"
    driver.write_text(driver.read_text().replace("-0.6 * offset", "-0.1 * offset"))
    return before, write_run(toycar, place / "after", lane_is_left)


@pytest.fixture(scope="module")
def found(runs: tuple[Path, Path]) -> Comparison:
    return compare_runs(*runs)


def lanes(found: Comparison) -> int:
    return sum(p.b.fault.fault_type == "lane" for p in found.pairs)


def test_a_changed_source_file_is_named(found: Comparison) -> None:
    assert [fact.name for fact in found.facts if fact.is_different] == ["digest of target"]
    assert comparison_files.differing_files_text(found) == "Files of the target changed: toycar/driver.py."
    assert found.remarks == ()


def test_pairs_in_which_one_run_stops_get_a_remark(found: Comparison) -> None:
    first, *rest = found.pairs
    stopped = replace(first, b=replace(first.b, after_hazard=AfterHazard.STOP))
    (remark,) = differing_pairs_remarks(found.a, found.b, replace(found.matching, pairs=(stopped, *rest)))
    assert remark.startswith("Pairs that end at a terminal hazard in only one run, where")
    assert remark.endswith(f": 1 of {len(found.pairs)}.")


def test_a_gate_names_each_new_hazard_once(found: Comparison) -> None:
    new = findings_of_gates(found, [Gate.NEW_HAZARD])
    assert 0 < len(new) <= lanes(found)
    assert all(
        "sensor/lane/shifted" in f.description and "masked -> hazard (H3 2.00 s" in f.description for f in new
    )
    assert findings_of_gates(found, [Gate.UNMATCHED, Gate.LOST_ALERT, Gate.HARNESS_ERROR]) == ()
    assert found.missing_result_count == 0


def test_the_tables_agree_with_the_pairs(found: Comparison) -> None:
    """The p-values are those of McNemar's test, with Holm's correction."""
    endings, changes, rates, _, by_type, _ = found.sheets
    assert sum(sum(line[1:]) for line in endings.lines) == len(found.pairs) == 24  # type: ignore[arg-type]
    total = dict(zip(changes.heads, changes.lines[-1], strict=True))
    new = len(findings_of_gates(found, [Gate.NEW_HAZARD]))
    assert (total["pairs"], total["new-hazard"]) == (24, new)
    [hazard] = [line for line in rates.lines if line[0] == "hazard"]
    line = dict(zip(rates.heads, hazard, strict=True))
    assert (line["only before"], line["only after"]) == (0, new)
    assert line["p"] == pytest.approx(2 * 0.5**new)
    kinds = [dict(zip(by_type.heads, line, strict=True)) for line in by_type.lines if line[0] == "hazard"]
    assert {kind["fault type"]: kind["only after"] for kind in kinds} == {
        "sensor/distance": 0,
        "sensor/lane": new,
        "sensor/silence": 0,
    }
    assert {kind["p, Holm"] for kind in kinds} == {1.0, min(1.0, 3 * 2 * 0.5**new)}


def test_a_run_compared_with_itself_has_no_changes(runs: tuple[Path, Path]) -> None:
    found = compare_runs(runs[1], runs[1])
    assert found.changed_pairs == ()
    assert not any(fact.is_different for fact in found.facts)
    others = [g for g in Gate if not g.value.startswith("severity:") and g is not Gate.SMALLER_ENVELOPE]
    assert findings_of_gates(found, others) == ()
    assert "None of them changed" in comparison_files.summary_text(found)


def test_the_gate_on_envelopes_needs_explorations(runs: tuple[Path, Path]) -> None:
    """A gate that cannot fail must not pass."""
    with pytest.raises(MutatorError, match="no exploration"):
        findings_of_gates(compare_runs(*runs), [Gate.SMALLER_ENVELOPE])


def test_the_gate_refuses_what_cannot_be_compared(runs: tuple[Path, Path]) -> None:
    """Another window of observation, unfinished planes and faults that were never active are wrong input."""
    before, inactive = envelope_of(never), envelope_of(never)
    results = inactive.exploration.map.results
    results.update({cell: replace(result, is_activated=False) for cell, result in results.items()})
    for other, text in (
        (envelope_of(never, observe_s=5.0), "observation times in s differ"),
        (envelope_of(never, most_runs=20), "is not decided"),
        (inactive, "is not decided"),
    ):
        comparison = replace(compare_runs(*runs), envelopes=([before], [other]))
        with pytest.raises(MutatorError, match=text) as refusal:
            findings_of_gates(comparison, [Gate.SMALLER_ENVELOPE])
        assert refusal.value.remedy


def test_differing_versions_are_reported(runs: tuple[Path, Path]) -> None:
    sides = [load_compared_run(runs[0]) for _ in "ab"]
    old = SessionEnvironment(
        python="CPython 3.11.7", packages={"numpy": "2.0"}, platform="Linux", cpu="Cray 1"
    )
    new = replace(old, python="CPython 3.12.1", packages={"numpy": "2.1", "cv": "5"})
    for side, stretches in zip(sides, ((old,), (old, new)), strict=True):
        vars(side.folder)["head"] = replace(side.folder.head, stretches=stretches)
    differing = {f.name: (f.a, f.b) for f in input_facts(*sides) if f.is_different}
    python = {"python": ("CPython 3.11.7", "CPython 3.11.7, CPython 3.12.1")}
    assert differing == python | {"package numpy": ("2.0", "2.0, 2.1"), "package cv": ("-", "5")}


def test_a_comparison_can_be_filtered(runs: tuple[Path, Path]) -> None:
    found = compare_runs(*runs, only='fault_type == "lane"')
    assert len(found.pairs) == lanes(found) > 0
    assert found.unmatched_experiments == ()


def test_runs_without_a_common_experiment_are_refused(runs: tuple[Path, Path]) -> None:
    with pytest.raises(MutatorError, match="has a partner"):
        compare_runs(*runs, only="value == -1")


def test_a_run_with_a_failed_proof_is_not_compared(
    runs: tuple[Path, Path], tmp_path: Path, reseal: Callable[[Path], None]
) -> None:
    after = shutil.copytree(runs[1], tmp_path / "after")
    (after / "proof").mkdir()
    lines = (after / "records" / "0001-a.jsonl").read_text().replace('"outcome":"masked"', '"outcome":"sdc"')
    (after / "proof" / "0001-a.jsonl").write_text(lines)
    reseal(after)
    with pytest.raises(CheckFailed, match="reference engine"):
        compare_runs(runs[0], after)


def test_missing_results_do_not_affect_rates(toycar: Workspace, tmp_path: Path, write_run: Write) -> None:
    broken = {"status": Status.HARNESS_ERROR, "outcome": None, "activation": None, "detail": "no disk"}
    a = write_run(toycar, tmp_path / "a", lambda e: HAZARD)
    b = write_run(
        toycar, tmp_path / "b", lambda e: {"lane": broken, "silence": None}.get(e.fault.fault_type, HAZARD)
    )
    found = compare_runs(a, b)
    kinds = [e.fault.fault_type for e in found.b.experiments]
    assert found.missing_result_count == kinds.count("lane") + kinds.count("silence") > 0
    assert dict(comparison_files.unmatched_count_by_reason(found)) == {
        "without a result in b": kinds.count("silence")
    }
    assert len(findings_of_gates(found, [Gate.HARNESS_ERROR])) == kinds.count("lane")
    rates = found.sheets[2]
    assert {line[1] for line in rates.lines} == {kinds.count("distance")}
    assert "a run has a harness error or an invalid mutant" in comparison_files.summary_text(found)


class Page(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.tags: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        named = dict(attributes)
        self.loaded += [v for k, v in named.items() if v and (k == "src" or (k == "href" and tag == "link"))]


def test_the_page_the_markdown_and_the_csv_file_list_every_change(found: Comparison, tmp_path: Path) -> None:
    written = comparison_files.write_comparison(found, tmp_path / "out")
    pairs = list(csv.DictReader(written.pairs.open()))
    assert len(pairs) == 24
    assert sum(p["changes"] == "new-silent-hazard;new-hazard;worse" for p in pairs) == len(
        findings_of_gates(found, [Gate.NEW_HAZARD])
    )
    text = written.page.read_text()
    page = Page(text)
    assert page.loaded == ["data:,"]  # the empty icon, which keeps browsers from requesting one
    assert page.tags.count("b") == 0
    for pair in found.changed_pairs:
        assert pair.b.id in text
        assert pair.b.id in written.markdown.read_text()
    assert {p.name for p in (tmp_path / "out" / "tables").iterdir()} == {
        f"{sheet.name}.csv" for sheet in found.sheets
    }


def test_comparing_again_gives_the_same_bytes(
    found: Comparison, runs: tuple[Path, Path], tmp_path: Path
) -> None:
    one, two = (
        comparison_files.write_comparison(c, tmp_path / name)
        for c, name in ((found, "a"), (compare_runs(*runs), "b"))
    )
    for a, b in ((one.page, two.page), (one.markdown, two.markdown), (one.pairs, two.pairs)):
        assert a.read_bytes() == b.read_bytes()


def test_a_long_page_shows_the_first_changes_without_scripts(
    found: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparison_files, "MOST_SHOWN_ROWS", 3)
    text = comparison_files.write_comparison(found, tmp_path / "out").page.read_text()
    rows = [line for line in text.splitlines() if '<span class="change' in line]
    assert len(rows) == len(found.changed_pairs) > 3
    assert "#changed:not([data-filtered]) tbody tr:nth-child(n + 4) { display: none; }" in text
    assert f"At most 3 of the {len(rows)} experiments are shown at once" in text
