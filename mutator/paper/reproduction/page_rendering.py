"""Renders the pages of the study from its tables, the paper's numbers, and templates.

Templates have no number of a campaign: every table and every sentence that judges comes from here.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from mutator._common.table_rendering import TextTable
from mutator.errors import MutatorError
from mutator.paper.fault_type_rank_agreement import GUIDED
from mutator.paper.observation_judging import ClaimVerdict
from mutator.paper.published_numbers import PublishedNumbers
from mutator.paper.reproduction.campaign_tables import ALL_TYPES, WITHOUT_FRAMES
from mutator.paper.reproduction.study_campaigns import StudyCampaign
from mutator.paper.reproduction.study_tables import HEADS, Row, StudyTables, tally_of_row
from mutator.paper.reproduction.tally_texts import (
    AGREEMENT_LABELS,
    NEAR_POINTS,
    NOTHING,
    agreement_cells,
    count_text,
    percent_text,
    points_between,
    share_of_tally,
    with_difference,
)
from mutator.statistics.guided_against_random import RANDOM
from mutator.statistics.tallies import Tally, sum_tallies

PAPER = "paper"
_MEASURES = (
    ("manifested", "manifested"),
    ("hazards", "hazards"),
    ("alerts", "alerts"),
    ("hazards without alert", "hazards_no_alerts"),
    ("alerts without hazard", "alerts_no_hazards"),
)
_BLOCK = re.compile(r"<!-- study: (\w+) -->\n.*?<!-- end of study -->", re.DOTALL)


@dataclass(frozen=True, kw_only=True)
class StudyPages:
    """What templates can name."""

    tables: StudyTables
    campaigns: Sequence[StudyCampaign]
    published: PublishedNumbers

    @property
    def whole(self) -> list[StudyCampaign]:
        """The campaigns that are no samples."""
        return [campaign for campaign in self.campaigns if not campaign.is_sample]

    @cached_property
    def commit(self) -> str:
        """The commit at which the runs were driven."""
        return self._only_commit("commit")

    @cached_property
    def tables_commit(self) -> str:
        """The commit whose code computed the tables."""
        return self._only_commit("tables_commit")

    def _only_commit(self, column: str) -> str:
        commits = {row[column] for row in self.tables.rows("runs")}
        return commits.pop() if len(commits) == 1 else "different commits"

    def results_page(self) -> str:
        """Return the whole page with the results."""
        from jinja2 import Environment, PackageLoader, StrictUndefined

        environment = Environment(
            loader=PackageLoader("mutator.paper.reproduction", "pages"),
            undefined=StrictUndefined,
            keep_trailing_newline=True,
            trim_blocks=True,
            lstrip_blocks=True,
            autoescape=False,
        )
        return environment.get_template("paper-results.md.j2").render(study=self)

    def with_blocks(self, page: str) -> str:
        """Return a page with its marked blocks rendered again. MutatorError for a block without renderer."""
        return _BLOCK.sub(self._rendered_block, page)

    def _rendered_block(self, match: re.Match[str]) -> str:
        renderer: Any = getattr(self, f"{match[1]}_table", None)
        if renderer is None:
            raise MutatorError(f"a block '{match[1]}' that no table of the study fills")
        return f"<!-- study: {match[1]} -->\n{renderer()}\n<!-- end of study -->"

    def runs_table(self) -> str:
        heads = ("campaign", "experiments", "seal", "results digest")
        rows = [
            (row["title"], f"{int(row['experiments']):,}", f"`{row['seal']}`", f"`{row['results_digest']}`")
            for row in self.tables.rows("runs")
        ]
        return _markdown(heads, rows)

    def table_links(self) -> str:
        """Return links to all tables, which lie in a folder beside the page."""
        return ", ".join(f"[{name}](tables/{name}.csv)" for name in HEADS)

    def versions(self) -> str:
        """Return the versions that computed the results."""
        rows = self.tables.rows("runs")
        python, mutator = (", ".join(sorted({row[key] for row in rows})) for key in ("python", "mutator"))
        return f"{python} and mutator {mutator}"

    def data_set_table(self) -> str:
        rows = [
            (f"`{row['file']}`", f"{int(row['bytes']):,}", f"`{row['sha256']}`")
            for row in self.tables.rows("data_set")
        ]
        return _markdown(("file", "bytes", "SHA-256"), rows)

    def fault_types_table(self, method: str, part: str, whole: str) -> str:
        """Tabulate a share by fault type, with the paper's."""
        kinds = [kind for how, kind in self.published.tally_by_fault_type if how == method]
        rows = []
        for kind in (*kinds, "total"):
            names = kinds if kind == "total" else [kind]
            published = sum_tallies(self.published.tally_by_fault_type[method, name] for name in names)
            cells = [str(share_of_tally(published, part, whole))]
            cells += [
                str(share_of_tally(self._tally(c.name, method, names), part, whole)) for c in self.whole
            ]
            rows.append((kind, *cells))
        return _markdown(("fault type", PAPER, *(c.title for c in self.whole)), rows)

    def scenarios_table(self, method: str) -> str:
        """Tabulate table II: shares of activated faults by scenario."""
        scenarios = self._scenarios(method)
        rows = []
        for label, part in _MEASURES:
            for source, tallies in self._tallies_by_source(method, scenarios):
                cells = [count_text(tally, part) for tally in (*tallies, sum_tallies(tallies))]
                rows.append((label, source, *cells))
        return _markdown(("measure", "source", *scenarios, "all"), rows)

    def alerts_table(self, method: str = GUIDED) -> str:
        """Tabulate the share of activated faults with an alert, and its difference from the paper's in
        points: bold if it is more than `NEAR_POINTS`.
        """
        scenarios = self._scenarios(method)
        (_, published), *others = self._tallies_by_source(method, scenarios)
        rows = [(PAPER, *(percent_text(tally, "alerts") for tally in (*published, sum_tallies(published))))]
        for source, tallies in others:
            pairs = zip((*tallies, sum_tallies(tallies)), (*published, sum_tallies(published)), strict=True)
            rows.append(
                (
                    source,
                    *(with_difference(tally, published_tally, "alerts") for tally, published_tally in pairs),
                )
            )
        return _markdown(("alerts of activated", *scenarios, "all"), rows)

    def kinds_of_alerts_table(self, method: str = GUIDED) -> str:
        """Tabulate in how many runs of each scenario each alert was raised."""
        scenarios = self._scenarios(method)
        rows = []
        for campaign in self.whole:
            of_campaign = self.tables.rows("alerts", campaign=campaign.name, method=method)
            for alert in sorted({row["alert"] for row in of_campaign}):
                runs = {row["scenario"]: row["runs"] for row in of_campaign if row["alert"] == alert}
                rows.append((campaign.title, alert, *(runs.get(name, "0") for name in scenarios)))
        return _markdown(("campaign", "alert", *scenarios), rows)

    def alerts_by_fault_type_table(self, campaign: str) -> str:
        """Tabulate, for one campaign, how many activated guided faults raised an alert, by scenario."""
        rows_of_campaign = self.tables.rows("alerts_by_fault_type", campaign=campaign)
        scenarios = sorted({row["scenario"] for row in rows_of_campaign})
        rows = []
        for kind in dict.fromkeys(row["fault_type"] for row in rows_of_campaign):
            cells = {row["scenario"]: row for row in rows_of_campaign if row["fault_type"] == kind}
            texts = [
                f"{cells[s]['alerts']} of {cells[s]['activated']}" if s in cells else "-" for s in scenarios
            ]
            rows.append((kind, *texts))
        return _markdown(("fault type", *scenarios), rows)

    def fault_free_alerts(self) -> str:
        """Say which fault-free runs raise an alert or have a hazard."""
        rows = self.tables.rows("fault_free")
        seeds_by_event: dict[tuple[str, str], list[str]] = {}
        for campaign in self.campaigns:
            for row in self.tables.rows("fault_free", campaign=campaign.name):
                if events := " and ".join(filter(None, (row["alerts"], row["hazards"]))):
                    drive = " with ".join(filter(None, (row["scenario"], row["changes"])))
                    seeds = seeds_by_event.setdefault((f"{drive} ({campaign.title})", events), [])
                    seeds += [row["seed"]] if campaign.is_sample else []
        runs = f"the {len(rows)} fault-free runs of these campaigns"
        if not seeds_by_event:
            return f"None of {runs} raises an alert or has a hazard."
        texts = (
            f"{drive}{' with seed ' + ', '.join(seeds) if seeds else ''}: {events}"
            for (drive, events), seeds in seeds_by_event.items()
        )
        return f"Alerts and hazards of {runs}: {'; '.join(texts)}."

    def summary_table(self) -> str:
        measures = (
            ("hazards", "hazards"),
            ("hazards without an alert", "hazards_no_alerts"),
            ("alerts", "alerts"),
        )
        rows = [self._total_row(label, GUIDED, part) for label, part in measures]
        for label, types in (
            ("hazards by fault type: rank correlation with the paper", ALL_TYPES),
            ("the same, types without camera frames", WITHOUT_FRAMES),
        ):
            cells = [
                "".join(
                    map(_interval_text, self.tables.rows("agreement", campaign=c.name, fault_types=types))
                )
                for c in self.whole
            ]
            rows.append((label, "", *(cell or "-" for cell in cells)))
        rows.append(self._total_row("hazards, random", RANDOM, "hazards"))
        heads = ("of activated faults, guided except in the last line", PAPER, *(c.title for c in self.whole))
        return f"{_markdown(heads, rows)}\n\n{self._summary_lines()}"

    def _summary_lines(self) -> str:
        """List by fixed rules which campaigns are near the paper, and which rank fault types as it does."""
        sources = self._tallies_by_source(GUIDED, self._scenarios(GUIDED))
        published, *totals = (sum_tallies(tallies) for _, tallies in sources)
        near: dict[str, list[str]] = {"hazards": [], "hazards_no_alerts": [], "alerts": []}
        for campaign, total in zip(self.whole, totals, strict=True):
            for part, titles in near.items():
                if total.activated and abs(points_between(total, published, part)) <= NEAR_POINTS:
                    titles.append(campaign.title)
        ranked = [
            campaign.title
            for campaign in self.whole
            for row in self.tables.rows("agreement", campaign=campaign.name, fault_types=ALL_TYPES)
            if float(row["low"]) > 0
        ]
        lines = [
            f"* {label} within ten points of the paper's: {_joined(near[part])}"
            for label, part in (
                ("hazards", "hazards"),
                ("hazards without an alert", "hazards_no_alerts"),
                ("alerts", "alerts"),
            )
        ]
        return "\n".join((*lines, f"* rank correlation above 0, with its whole interval: {_joined(ranked)}"))

    def agreement_table(self) -> str:
        """Tabulate what agrees with the paper in guided experiments, and what does not, for each campaign."""
        published = {
            kind: tally for (how, kind), tally in self.published.tally_by_fault_type.items() if how == GUIDED
        }
        sources = self._tallies_by_source(GUIDED, self._scenarios(GUIDED))
        columns = []
        for campaign, (_, by_scenario) in zip((None, *self.whole), sources, strict=True):
            tallies = {
                kind: self._tally(campaign.name, GUIDED, [kind]) if campaign else tally
                for kind, tally in published.items()
            }
            columns.append(agreement_cells(tallies, published, sum_tallies(by_scenario)))
        rows = [(label, *cells) for label, *cells in zip(AGREEMENT_LABELS, *columns, strict=True)]
        return _markdown(("guided", PAPER, *(c.title for c in self.whole)), rows)

    def counts_table(self) -> str:
        """Tabulate the counts that explain differences from the paper, for each whole campaign."""
        counts: dict[str, dict[str, str]] = {}
        for row in self.tables.rows("explaining_counts"):
            counts.setdefault(row["what"], {})[row["campaign"]] = row["count"]
        rows = [(what, *(cells.get(c.name, "-") for c in self.whole)) for what, cells in counts.items()]
        return _markdown(
            ("guided and activated, unless it says otherwise", *(c.title for c in self.whole)), rows
        )

    def observations_table(self) -> str:
        """Tabulate each observation's verdict in each campaign, with what would change it."""
        rows = []
        for number, title in dict.fromkeys(
            (row["observation"], row["title"]) for row in self.tables.rows("observations")
        ):
            cells = []
            for campaign in self.campaigns:
                [row] = self.tables.rows("observations", campaign=campaign.name, observation=number)
                cells.append(f"**{row['verdict']}** ({row['change']})")
            rows.append((f"{number}: {title}", row["on_paper"] or "-", *cells))
        return _markdown(("observation", f"{PAPER}, by its counts", *(c.title for c in self.campaigns)), rows)

    def claims_list(self) -> str:
        """Tabulate what each claim says, with its rule. A star marks those that decide an observation."""
        rows = dict.fromkeys(
            (_starred(row), row["says"], row["rule"]) for row in self.tables.rows("claims") if row["rule"]
        )
        return _markdown(("claim", "says", "rule"), list(rows))

    def claims_table(self, campaign: str) -> str:
        """Tabulate the claims of one campaign: estimate, verdict, and what would change it."""
        rows = [
            (
                _starred(row),
                row["group"],
                row["estimate"],
                row["verdict"],
                row["change"] or "-",
            )
            for row in self.tables.rows("claims", campaign=campaign)
        ]
        return _markdown(("claim", "", "here", "verdict", "would change with"), rows)

    def seeds_table(self) -> str:
        heads = ("share", "all seeds, 95 % of runs", "95 % between seeds", "least", "largest")
        rows = [
            tuple(row[key] for key in ("share", "all_seeds", "between_seeds", "least", "largest"))
            for row in self.tables.rows("seeds")
        ]
        return _markdown(heads, rows)

    def seed_verdicts_table(self) -> str:
        """Count the seeds in which each observation holds."""
        rows = []
        for number, title in dict.fromkeys(
            (row["observation"], row["title"]) for row in self.tables.rows("observations")
        ):
            of_seeds = self.tables.rows("observations_by_seed", observation=number)
            seeds = {
                verdict: [row["seed"] for row in of_seeds if row["verdict"] == verdict.value]
                for verdict in ClaimVerdict
            }
            cells = [f"{len(names)} ({', '.join(names)})" if names else "0" for names in seeds.values()]
            rows.append((f"{number}: {title}", *cells))
        return _markdown(("observation", *(f"{verdict.value} (seeds)" for verdict in ClaimVerdict)), rows)

    def seed_changes_table(self) -> str:
        """Tabulate each seed's verdicts, with what would change them."""
        rows_by_seed: dict[str, list[Row]] = {}
        for row in self.tables.rows("observations_by_seed"):
            rows_by_seed.setdefault(row["seed"], []).append(row)
        numbers = dict.fromkeys(row["observation"] for row in self.tables.rows("observations_by_seed"))
        rows = [
            (seed, *(f"**{row['verdict']}** ({row['change']})" for row in of_seed))
            for seed, of_seed in rows_by_seed.items()
        ]
        return _markdown(("seed", *(f"observation {number}" for number in numbers)), rows)

    def _total_row(self, label: str, method: str, part: str) -> tuple[str, ...]:
        sources = self._tallies_by_source(method, self._scenarios(method))
        return (label, *(percent_text(sum_tallies(tallies), part) for _, tallies in sources))

    def _scenarios(self, method: str) -> list[str]:
        return sorted(name for how, name in self.published.tally_by_scenario if how == method)

    def _tallies_by_source(self, method: str, scenarios: Sequence[str]) -> list[tuple[str, list[Tally]]]:
        sources = [(PAPER, [self.published.tally_by_scenario[method, name] for name in scenarios])]
        for campaign in self.whole:
            rows = self.tables.rows("scenarios", campaign=campaign.name, method=method)
            by_name = {row["scenario"]: tally_of_row(row) for row in rows}
            sources.append((campaign.title, [by_name.get(name, NOTHING) for name in scenarios]))
        return sources

    def _tally(self, campaign: str, method: str, kinds: Iterable[str]) -> Tally:
        rows: list[Row] = self.tables.rows("fault_types", campaign=campaign, method=method)
        by_name = {row["fault_type"]: tally_of_row(row) for row in rows}
        return sum_tallies(by_name.get(kind, NOTHING) for kind in kinds)


def _starred(row: Row) -> str:
    return row["claim"] + ("*" if row["needed"] else "")


def _joined(titles: Sequence[str]) -> str:
    """Return `as coded; as described`, or `no campaign`."""
    return "; ".join(titles) or "no campaign"


def _interval_text(row: Row) -> str:
    return f"{row['correlation']} ({row['low']} to {row['high']})"


def _markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return TextTable(heads=heads, rows=rows).as_markdown(escape=False)
