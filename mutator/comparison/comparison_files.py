"""Writes a comparison as Markdown, one self-contained HTML page, and CSV files."""

import csv
import io
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.below import inside
from mutator._common.files import make_folder, write_atomic
from mutator._common.tables import Table, markdown_line
from mutator._common.text import counted
from mutator.comparison.input_differences import Fact
from mutator.comparison.pairs import Change, Pair, time_to_hazard
from mutator.comparison.run_comparison import Comparison, Gate, ending_change
from mutator.results.plan_columns import plan_row
from mutator.results.result_rows import Row
from mutator.web import asset, load_order

LISTED = 50  # number of experiments that the Markdown lists for each change; the page and the CSV list all
SHOWN = 500  # table rows that the page shows at once; browsers need seconds to lay out thousands
_BAD = frozenset(gate.value for gate in Gate)


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    markdown: Path
    page: Path
    pairs: Path


def write(comparison: Comparison, out: Path) -> Written:
    """Write all forms of the comparison into `out`, which is created if missing. Equal inputs give equal
    bytes.
    """
    make_folder(out / "tables")
    text, hypertext, pairs = out / "COMPARISON.md", out / "index.html", out / "pairs.csv"
    for sheet in comparison.sheets:
        write_atomic(inside(out / "tables", f"{sheet.name}.csv"), sheet.csv().encode())
    write_atomic(pairs, pairs_csv(comparison))
    write_atomic(out / "unmatched.csv", unmatched_csv(comparison))
    write_atomic(text, markdown(comparison).encode())
    write_atomic(hypertext, page(comparison).encode())
    return Written(markdown=text, page=hypertext, pairs=pairs)


def pairs_csv(comparison: Comparison) -> bytes:
    return _table(pair_line(p) for p in comparison.pairs)


def unmatched_csv(comparison: Comparison) -> bytes:
    unmatched = ({"why": why, "experiment": e.id, "words": e.label} for why, e in comparison.unmatched)
    return _table(unmatched, heads=("why", "experiment", "words"))


def summary(comparison: Comparison) -> str:
    c = comparison
    counts = Counter(change for pair in c.pairs for change in pair.changes)
    text = f"In both runs: {counted(len(c.pairs), 'experiment')}. "
    if counts:
        listed = ", ".join(f"{change.value} {counts[change]}" for change in Change if counts[change])
        text += f"{len(c.changed)} of them changed: {listed}."
    else:
        text += "None of them changed."
    if unusable := sum(not p.usable for p in c.pairs):
        text += " Left out of the rates, because a run has a harness error or an invalid mutant: "
        text += f"{unusable}."
    if c.unmatched:
        text += " Not compared: " + ", ".join(f"{n} {why}" for why, n in reasons(c)) + "."
    return text


def reasons(comparison: Comparison) -> list[tuple[str, int]]:
    return list(Counter(why for why, _ in comparison.unmatched).items())


def files_text(comparison: Comparison) -> str:
    found = comparison.files
    parts = {
        "changed": found.changed,
        f"only in {comparison.names.a}": found.only_a,
        f"only in {comparison.names.b}": found.only_b,
    }
    named = [f"{what}: {', '.join(paths)}" for what, paths in parts.items() if paths]
    return f"Files of the target {'; '.join(named)}." if named else "The target's files are the same."


def markdown(comparison: Comparison) -> str:
    c = comparison
    parts = [f"# {c.names.a} against {c.names.b}", summary(c), *c.remarks, "## What differs between the runs"]
    differing = _facts(c, [fact for fact in c.facts if fact.differs])
    if differing.rows:
        parts.append(differing.as_markdown())
    else:
        parts.append("Nothing: the same sources, choices and versions.")
    parts.append(files_text(c))
    parts += [sheet.markdown().rstrip() for sheet in c.sheets]
    for change in Change:
        if pairs := c.having(change):
            parts += [f"## {change.value}: {len(pairs)}", _listed(pairs)]
    if c.unmatched:
        parts += ["## Not compared", _reasons(c).as_markdown()]
        parts.append("`unmatched.csv` lists these experiments.")
    parts.append("All pairs are in `pairs.csv`; `index.html` lists those that changed.")
    return "\n\n".join(parts) + "\n"


def _listed(pairs: tuple[Pair, ...]) -> str:
    lines = [
        f"- {p.b.label}: {markdown_line(ending_change(p))} (`{p.a.id}`, `{p.b.id}`)" for p in pairs[:LISTED]
    ]
    more = len(pairs) - LISTED
    return "\n".join([*lines, f"- and {more} more"] if more > 0 else lines)


def _facts(comparison: Comparison, facts: Sequence[Fact]) -> Table:
    names = comparison.names
    return Table(
        heads=("what", names.a, names.b), rows=[(fact.name, fact.a, fact.b) for fact in facts], named=True
    )


def _reasons(comparison: Comparison) -> Table:
    rows = [(why, str(number)) for why, number in reasons(comparison)]
    return Table(heads=("why", "experiments"), rows=rows, right=(1,))


def page(comparison: Comparison) -> str:
    """Return the comparison as one HTML page. All text from runs is escaped."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    counts = Counter(change for pair in comparison.pairs for change in pair.changes)
    return environment.from_string(asset("comparison/comparison.html")).render(
        c=comparison,
        summary=summary(comparison),
        differing=_facts(comparison, [fact for fact in comparison.facts if fact.differs]),
        origin=_facts(comparison, [f for f in comparison.facts if not f.name.startswith("package ")]),
        files=files_text(comparison),
        counts=[(change.value, counts[change]) for change in Change if counts[change]],
        reasons=_reasons(comparison),
        changed=_changed(comparison),
        limit=SHOWN,
        style=Markup(style()),
        script=Markup(asset("comparison/comparison.js")),
    )


def style() -> str:
    return "".join(map(asset, load_order("comparison", ".css"))).replace("LIMIT", str(SHOWN + 1))


def _changed(comparison: Comparison) -> Table:
    a, b = comparison.names.a, comparison.names.b
    heads = ("experiment", "what changed", a, b, f"hazard, {a} [s]", f"hazard, {b} [s]", "ids")
    return Table(heads=heads, rows=list(map(_changed_row, comparison.changed)), right=(4, 5))


def _changed_row(pair: Pair) -> tuple[str, ...]:
    from markupsafe import Markup

    badge = Markup('<span class="change{}">{}</span> ').format
    changes = [change.value for change in Change if change in pair.changes]
    sides = (pair.row_a, pair.row_b)
    return (
        pair.b.label,
        Markup("").join(badge(" bad" if change in _BAD else "", change) for change in changes),
        *map(_ending, sides),
        *map(_hazard_time, sides),
        Markup("<br>").join(map(Markup("<code>{}</code>").format, dict.fromkeys((pair.a.id, pair.b.id)))),
    )


def _ending(row: Row) -> str:
    from markupsafe import Markup

    details = [name for name, _ in row.hazards] + [f"alert {name}" for name in row.alerts]
    if row.severity:
        details.insert(0, row.severity)
    if row.detail:
        details.append(row.detail)
    return Markup('<span class="ending {0}">{0}</span> {1}').format(row.ending, ", ".join(details))


def _hazard_time(row: Row) -> str:
    time = time_to_hazard(row)
    return "" if time is None else f"{time:.2f}"


def pair_line(pair: Pair) -> dict[str, object]:
    """Return a pair's line in pairs.csv. Times are in simulated seconds."""
    planned = plan_row(pair.b)
    line: dict[str, object] = {
        "experiment_a": pair.a.id,
        "experiment_b": pair.b.id,
        **{name: planned[name] for name in ("module", "fault_type", "variant")},
        "value": "" if planned["value"] is None else str(planned["value"]),
        **{name: planned[name] for name in ("unit", "scenario", "method", "trigger")},
        "changes": ";".join(change.value for change in Change if change in pair.changes),
    }
    sides = [dict(_side_cells(row)) for row in (pair.row_a, pair.row_b)]
    return line | {f"{k}_{s}": side[k] for k in sides[0] for s, side in zip("ab", sides, strict=True)}


def _side_cells(row: Row) -> Iterator[tuple[str, object]]:
    yield "ending", row.ending
    yield "t_activation", row.t_activation
    yield "t_manifest", row.t_manifest
    yield "hazards", ";".join(name for name, _ in row.hazards)
    yield "t_hazard", row.hazards[0][1] if row.hazards else None
    yield "alerts", ";".join(row.alerts)
    yield "t_alert", row.t_alert
    yield "severity", row.severity
    yield "delta_v", row.delta_v


def _table(lines: Iterable[Mapping[str, object]], heads: tuple[str, ...] = ()) -> bytes:
    made = list(lines)
    text = io.StringIO()
    writer = csv.DictWriter(text, heads or tuple(made[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(made)
    return text.getvalue().encode()
