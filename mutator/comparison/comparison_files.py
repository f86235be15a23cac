"""Writes a comparison as Markdown, one self-contained HTML page, and CSV files."""

import csv
import io
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import make_folder, write_atomic
from mutator._common.message_text import counted, with_unbreakable_numbers
from mutator._common.table_rendering import TextTable, escaped_markdown_line
from mutator.comparison.comparison_replays import ReportAddresses, addresses_from, replay_elements
from mutator.comparison.envelope_changes import describe_envelope_changes
from mutator.comparison.envelope_pictures import draw_envelope_changes
from mutator.comparison.experiment_matching import ExperimentPair, ResultChangeKind, time_to_hazard
from mutator.comparison.input_differences_and_remarks import InputFact
from mutator.comparison.run_comparison_and_gates import Comparison, Gate, describe_ending_change
from mutator.results.plan_columns import plan_row
from mutator.results.result_rows import ResultRow
from mutator.web import asset_text, load_order
from mutator.web.html_templates import html_environment

MOST_LISTED_EXPERIMENTS = (
    50  # number of experiments that the Markdown lists for each change; the page and the CSV list all
)
MOST_SHOWN_ROWS = 500  # table rows that the page shows at once; browsers need seconds to lay out thousands
_WORSE_CHANGE_NAMES = frozenset(gate.value for gate in Gate)
_BETTER_CHANGE_NAMES = frozenset(
    kind.value
    for kind in (
        ResultChangeKind.GOLDEN_HAZARD_GONE,
        ResultChangeKind.HAZARD_GONE,
        ResultChangeKind.LOWER_SEVERITY,
        ResultChangeKind.LATER_HAZARD,
        ResultChangeKind.NEW_ALERT,
        ResultChangeKind.BETTER,
        ResultChangeKind.CRASH_GONE,
        ResultChangeKind.HARNESS_ERROR_GONE,
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonFiles:
    markdown: Path
    page: Path
    pairs: Path


def write_comparison(comparison: Comparison, out: Path) -> ComparisonFiles:
    """Write all forms of the comparison into `out`, which is created if missing. Equal inputs give equal
    bytes.
    """
    make_folder(out / "tables")
    text, hypertext, pairs = out / "COMPARISON.md", out / "index.html", out / "pairs.csv"
    for sheet in comparison.sheets:
        write_atomic(path_below(out / "tables", f"{sheet.name}.csv"), sheet.as_csv().encode())
    write_atomic(pairs, pairs_csv(comparison))
    write_atomic(out / "unmatched.csv", unmatched_csv(comparison))
    write_atomic(text, render_markdown(comparison).encode())
    page = render_html_page(comparison, addresses_from(out, comparison))
    write_atomic(hypertext, page.encode())
    return ComparisonFiles(markdown=text, page=hypertext, pairs=pairs)


def pairs_csv(comparison: Comparison) -> bytes:
    return _csv_bytes(pair_cells(p) for p in comparison.pairs)


def unmatched_csv(comparison: Comparison) -> bytes:
    unmatched = (
        {"why": why, "experiment": e.id, "words": e.label} for why, e in comparison.unmatched_experiments
    )
    return _csv_bytes(unmatched, heads=("why", "experiment", "words"))


def summary_text(comparison: Comparison) -> str:
    c = comparison
    counts = Counter(change for pair in c.pairs for change in pair.change_kinds)
    envelopes = describe_envelope_changes(c.envelope_changes)
    text = f"{envelopes} In both runs: {counted(len(c.pairs), 'experiment')}. ".lstrip()
    if counts:
        listed = ", ".join(
            f"{change.value} {counts[change]}" for change in ResultChangeKind if counts[change]
        )
        text += f"{len(c.changed_pairs)} of them changed: {listed}."
    else:
        text += "None of them changed."
    if unusable := sum(not p.is_usable for p in c.pairs):
        text += " Left out of the rates, because a run has a harness error or an invalid mutant: "
        text += f"{unusable}."
    if c.unmatched_experiments:
        text += " Not compared: " + ", ".join(f"{n} {why}" for why, n in unmatched_count_by_reason(c)) + "."
    return text


def unmatched_count_by_reason(comparison: Comparison) -> list[tuple[str, int]]:
    return list(Counter(why for why, _ in comparison.unmatched_experiments).items())


def differing_files_text(comparison: Comparison) -> str:
    differences = comparison.differing_target_files
    parts = {
        "changed": differences.changed,
        f"only in {comparison.names.a}": differences.only_a,
        f"only in {comparison.names.b}": differences.only_b,
    }
    named = [f"{what}: {', '.join(paths)}" for what, paths in parts.items() if paths]
    return f"Files of the target {'; '.join(named)}." if named else "The target's files are the same."


def render_markdown(comparison: Comparison) -> str:
    c = comparison
    parts = [
        f"# {c.names.a} against {c.names.b}",
        summary_text(c),
        *c.remarks,
        "## What differs between the runs",
    ]
    differing = _facts_table(c, [fact for fact in c.facts if fact.is_different])
    if differing.rows:
        parts.append(differing.as_markdown())
    else:
        parts.append("Nothing: the same sources, choices and versions.")
    parts.append(differing_files_text(c))
    parts += [sheet.as_markdown().rstrip() for sheet in c.sheets]
    for change in ResultChangeKind:
        if pairs := c.pairs_with_change(change):
            parts += [f"## {change.value}: {len(pairs)}", _pair_list(pairs)]
    if c.unmatched_experiments:
        parts += ["## Not compared", _unmatched_reasons_table(c).as_markdown()]
        parts.append("`unmatched.csv` lists these experiments.")
    parts.append("All pairs are in `pairs.csv`; `index.html` lists those that changed.")
    return "\n\n".join(parts) + "\n"


def _pair_list(pairs: tuple[ExperimentPair, ...]) -> str:
    lines = [
        f"- {p.b.label}: {escaped_markdown_line(describe_ending_change(p))} (`{p.a.id}`, `{p.b.id}`)"
        + (f" {escaped_markdown_line(p.row_b.sentence)}" if p.row_b.sentence else "")
        for p in pairs[:MOST_LISTED_EXPERIMENTS]
    ]
    more = len(pairs) - MOST_LISTED_EXPERIMENTS
    return "\n".join([*lines, f"- and {more} more"] if more > 0 else lines)


def _facts_table(comparison: Comparison, facts: Sequence[InputFact]) -> TextTable:
    names = comparison.names
    return TextTable(
        heads=("what", names.a, names.b),
        rows=[(fact.name, fact.a, fact.b) for fact in facts],
        has_row_headings=True,
    )


def _unmatched_reasons_table(comparison: Comparison) -> TextTable:
    rows = [(why, str(number)) for why, number in unmatched_count_by_reason(comparison)]
    return TextTable(heads=("why", "experiments"), rows=rows, right_aligned=(1,))


_HEAD_BY_WORD = {"worse": "Worse", "better": "Better", "otherwise": "Changed"}
_CHANGE_BY_WORD = {
    "worse": "got worse",
    "better": "got better",
    "otherwise": "changed without getting worse or better",
}


def verdict_word_and_sentence(comparison: Comparison) -> tuple[str, str]:
    """Return a word for the change from the first run to the second (worse, better, otherwise, same), and a
    sentence with the numbers of experiments. An experiment that is worse in any respect is not better.
    """
    all_kinds = [{kind.value for kind in pair.change_kinds} for pair in comparison.changed_pairs]
    worse = sum(bool(kinds & _WORSE_CHANGE_NAMES) for kinds in all_kinds)
    better = sum(
        bool(kinds & _BETTER_CHANGE_NAMES) and not kinds & _WORSE_CHANGE_NAMES for kinds in all_kinds
    )
    otherwise = len(all_kinds) - worse - better
    experiments = counted(len(comparison.pairs), "experiment")
    if not all_kinds:
        return "same", f"No change: {experiments} in both runs, with equal results."
    counts = {"worse": worse, "better": better, "otherwise": otherwise}
    parts = [f"{count} {_CHANGE_BY_WORD[word]}" for word, count in counts.items() if count]
    word = next(word for word, count in counts.items() if count)
    parts[0] = f"{counts[word]} of {experiments} in both runs {_CHANGE_BY_WORD[word]}"
    return word, f"{_HEAD_BY_WORD[word]}: {', '.join(parts)}."


def render_html_page(comparison: Comparison, addresses: ReportAddresses) -> str:
    """Return the comparison as one HTML page, which links to the reports. All text from runs is escaped."""
    from markupsafe import Markup

    # numbers are bound to their units in text, not in HTML
    environment = html_environment(
        lambda value: with_unbreakable_numbers(value) if type(value) is str else value
    )
    counts = Counter(change for pair in comparison.pairs for change in pair.change_kinds)
    return environment.from_string(asset_text("comparison/comparison.html")).render(
        c=comparison,
        verdict=verdict_word_and_sentence(comparison),
        summary=summary_text(comparison),
        differing=_facts_table(comparison, [fact for fact in comparison.facts if fact.is_different]),
        origin=_facts_table(comparison, [f for f in comparison.facts if not f.name.startswith("package ")]),
        files=differing_files_text(comparison),
        counts=[(change.value, counts[change]) for change in ResultChangeKind if counts[change]],
        reasons=_unmatched_reasons_table(comparison),
        changed=_changed_table(comparison, addresses),
        planes=list(draw_envelope_changes(comparison.envelope_changes)),
        report_b=addresses.b,
        limit=MOST_SHOWN_ROWS,
        styles=[Markup(text) for text in page_style_sheets()],
        data=[Markup(element) for element in replay_elements(comparison, addresses)],
        scripts=[Markup(asset_text(name)) for name in load_order("comparison", ".js")],
    )


def page_style_sheets() -> tuple[str, ...]:
    """Return the style sheets of the page."""
    return tuple(
        asset_text(name).replace("LIMIT", str(MOST_SHOWN_ROWS + 1))
        for name in load_order("comparison", ".css")
    )


def _changed_table(comparison: Comparison, addresses: ReportAddresses) -> TextTable:
    a, b = comparison.names.a, comparison.names.b
    heads = ("experiment", "what changed", a, b, f"hazard, {a} [s]", f"hazard, {b} [s]", "in the reports")
    rows = [_changed_row(pair, comparison, addresses) for pair in comparison.changed_pairs]
    return TextTable(heads=heads, rows=rows, right_aligned=(4, 5))


def _changed_row(pair: ExperimentPair, comparison: Comparison, addresses: ReportAddresses) -> tuple[str, ...]:
    from markupsafe import Markup

    badge = Markup('<span class="change{}">{}</span> ').format
    changes = [change.value for change in ResultChangeKind if change in pair.change_kinds]
    sides = (pair.row_a, pair.row_b)
    button = Markup('<button type="button" class="open" data-a="{}" data-b="{}">{}</button>').format
    return (
        button(pair.a.id, pair.b.id, pair.b.label),
        Markup("").join(badge(" bad" if change in _WORSE_CHANGE_NAMES else "", change) for change in changes),
        *map(_ending_html, sides),
        *map(_hazard_time_text, sides),
        Markup("<br>").join(
            (
                _experiment_link(addresses.a, pair.a.id, comparison.names.a),
                _experiment_link(addresses.b, pair.b.id, comparison.names.b),
            )
        ),
    )


def _experiment_link(address: str, experiment_id: str, name: str) -> str:
    from markupsafe import Markup

    code = Markup("<code>{}</code>").format(experiment_id)
    if not address:
        return code
    return Markup('<a href="{}#e={}" title="{}">{}</a>').format(
        address, experiment_id, f"in the report of {name}", code
    )


def _ending_html(row: ResultRow) -> str:
    from markupsafe import Markup

    details = [name for name, _ in row.hazards] + [f"alert {name}" for name in row.alerts]
    if row.severity:
        details.insert(0, row.severity_label)
    if row.detail:
        details.append(row.detail)
    ending = Markup('<span class="ending {0}">{0}</span> {1}').format(row.ending, ", ".join(details))
    sentence = Markup('<p class="sentence">{}</p>').format(with_unbreakable_numbers(row.sentence))
    return ending + sentence if row.sentence else ending


def _hazard_time_text(row: ResultRow) -> str:
    time = time_to_hazard(row)
    return "" if time is None else f"{time:.2f}"


def pair_cells(pair: ExperimentPair) -> dict[str, object]:
    """Return a pair's line in pairs.csv. Times are in simulated seconds."""
    planned = plan_row(pair.b)
    line: dict[str, object] = {
        "experiment_a": pair.a.id,
        "experiment_b": pair.b.id,
        **{name: planned[name] for name in ("module", "fault_type", "variant")},
        "value": "" if planned["value"] is None else str(planned["value"]),
        **{name: planned[name] for name in ("unit", "scenario", "method", "trigger")},
        "changes": ";".join(change.value for change in ResultChangeKind if change in pair.change_kinds),
    }
    sides = [dict(_side_cells(row)) for row in (pair.row_a, pair.row_b)]
    return line | {f"{k}_{s}": side[k] for k in sides[0] for s, side in zip("ab", sides, strict=True)}


def _side_cells(row: ResultRow) -> Iterator[tuple[str, object]]:
    yield "ending", row.ending
    yield "t_activation", row.t_activation
    yield "t_manifest", row.t_manifest
    yield "hazards", ";".join(name for name, _ in row.hazards)
    yield "t_hazard", row.hazards[0][1] if row.hazards else None
    yield "alerts", ";".join(row.alerts)
    yield "t_alert", row.t_alert
    yield "severity", row.severity
    yield "delta_v", row.delta_v


def _csv_bytes(lines: Iterable[Mapping[str, object]], heads: tuple[str, ...] = ()) -> bytes:
    rows = list(lines)
    text = io.StringIO()
    # there is always a pair; only the table of unmatched experiments can be empty
    writer = csv.DictWriter(text, heads or tuple(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()
