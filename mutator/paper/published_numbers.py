"""The published numbers, as cited in `references/` of the fault library."""

from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from mutator.config.yaml_files import StrictModel, read
from mutator.config.yaml_sources import Source
from mutator.statistics.published_counts import PublishedCounts
from mutator.statistics.tallies import Tally

FILES = ("paper_summary.yaml", "paper_coverage.yaml", "paper_times.yaml")


@dataclass(frozen=True, slots=True, kw_only=True)
class Paper:
    """The published counts. `coverage` has only injected, activated and hazards."""

    summary: dict[tuple[str, str], Tally]  # by method and scenario
    coverage: dict[tuple[str, str], Tally]  # by method and module/fault type
    driver_reaction_s: float
    least_alert_to_hazard_s: float  # the scenarios' smallest and largest mean
    most_alert_to_hazard_s: float

    def published(self) -> PublishedCounts:
        least, most = self.least_alert_to_hazard_s, self.most_alert_to_hazard_s
        return PublishedCounts(
            source="paper",
            by_scenario=self.summary,
            by_fault_type=self.coverage,
            scenario_title="the paper's table II",
            fault_type_title="the paper's table III",
            counts_note="The paper gives the counts; their intervals are computed here.",
            fault_type_note="The paper has only hazards/activated; hazards/injected is computed here.",
            times_note=f"The paper's mean times from alert to hazard lie between {least:g} and {most:g} s.",
            driver_reaction_s=self.driver_reaction_s,
        )


class _SummaryRow(StrictModel):
    method: str
    scenario: str
    injected: int = Field(ge=0)
    activated: int = Field(ge=0)
    manifested: int = Field(ge=0)
    hazards: int = Field(ge=0)
    alerts: int = Field(ge=0)
    hazards_no_alerts: int = Field(ge=0)
    alerts_no_hazards: int = Field(ge=0)


class _Summary(StrictModel):
    source: str
    rows: list[_SummaryRow]


class _CoverageRow(StrictModel):
    module: str
    fault_type: str
    injected: int = Field(ge=0)
    guided_activated: int = Field(ge=0)
    guided_hazards: int = Field(ge=0)
    random_activated: int = Field(ge=0)
    random_hazards: int = Field(ge=0)


class _Coverage(StrictModel):
    source: str
    rows: list[_CoverageRow]


class _Range(StrictModel):
    least: float
    most: float


class _Times(StrictModel):
    source: str
    driver_reaction_s: float = Field(gt=0)
    mean_alert_to_hazard_s: _Range


def load_paper(references: Path) -> Paper:
    """Load the numbers cited in a folder. MutatorError with file and line if counts are impossible."""
    summary, summary_source = read(references / FILES[0], _Summary, "paper_summary/1")
    coverage, coverage_source = read(references / FILES[1], _Coverage, "paper_coverage/1")
    times, _ = read(references / FILES[2], _Times, "paper_times/1")
    by_scenario = {}
    for i, row in enumerate(summary.rows):
        tally = Tally(**row.model_dump(exclude={"method", "scenario"}))
        _check(tally, summary_source, i)
        by_scenario[row.method, row.scenario] = tally
    by_kind = {}
    for i, line in enumerate(coverage.rows):
        kind = f"{line.module}/{line.fault_type}"
        for method, activated, hazards in (
            ("guided", line.guided_activated, line.guided_hazards),
            ("random", line.random_activated, line.random_hazards),
        ):
            tally = Tally(injected=line.injected, activated=activated, hazards=hazards)
            _check(tally, coverage_source, i)
            by_kind[method, kind] = tally
    return Paper(
        summary=by_scenario,
        coverage=by_kind,
        driver_reaction_s=times.driver_reaction_s,
        least_alert_to_hazard_s=times.mean_alert_to_hazard_s.least,
        most_alert_to_hazard_s=times.mean_alert_to_hazard_s.most,
    )


def has_paper(references: Path) -> bool:
    return all((references / name).is_file() for name in FILES)


def _check(tally: Tally, source: Source, row: int) -> None:
    """Raise MutatorError if a part exceeds its whole, or if counts of hazards and alerts are inconsistent."""
    parts = (tally.manifested or 0, tally.hazards, tally.alerts or 0)
    fits = tally.activated <= tally.injected and max(parts) <= tally.activated
    if tally.alerts is not None:
        warned = tally.hazards - (tally.hazards_no_alerts or 0)
        fits = fits and warned == tally.alerts - (tally.alerts_no_hazards or 0)
    if not fits:
        raise source.error(
            ("rows", row),
            f"counts that contradict each other: {tally}",
            expected="no count larger than one that includes it",
            remedy="compare with the published table",
        )
