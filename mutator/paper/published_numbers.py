"""The published numbers, as cited in `references/` of the fault library."""

from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.statistics.published_counts import PublishedCounts
from mutator.statistics.tallies import Tally

PUBLISHED_FILE_NAMES = ("paper_summary.yaml", "paper_coverage.yaml", "paper_times.yaml")


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedNumbers:
    """The published counts. `tally_by_fault_type` has only injected, activated and hazards."""

    tally_by_scenario: dict[tuple[str, str], Tally]  # by method and scenario
    tally_by_fault_type: dict[tuple[str, str], Tally]  # by method and module/fault type
    driver_reaction_s: float
    least_mean_alert_to_hazard_s: float  # the scenarios' smallest and largest mean
    most_mean_alert_to_hazard_s: float

    def as_published_counts(self) -> PublishedCounts:
        least, most = self.least_mean_alert_to_hazard_s, self.most_mean_alert_to_hazard_s
        return PublishedCounts(
            source="paper",
            by_scenario=self.tally_by_scenario,
            by_fault_type=self.tally_by_fault_type,
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


class _SummaryFile(StrictModel):
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


class _CoverageFile(StrictModel):
    source: str
    rows: list[_CoverageRow]


class _TimeRange(StrictModel):
    least: float
    most: float


class _TimesFile(StrictModel):
    source: str
    driver_reaction_s: float = Field(gt=0)
    mean_alert_to_hazard_s: _TimeRange


def load_published_numbers(references: Path) -> PublishedNumbers:
    """Load the numbers cited in a folder. MutatorError with file and line if counts are impossible."""
    summary, summary_source = load_yaml_model(
        references / PUBLISHED_FILE_NAMES[0], _SummaryFile, "paper_summary/1"
    )
    coverage, coverage_source = load_yaml_model(
        references / PUBLISHED_FILE_NAMES[1], _CoverageFile, "paper_coverage/1"
    )
    times, _ = load_yaml_model(references / PUBLISHED_FILE_NAMES[2], _TimesFile, "paper_times/1")
    tally_by_scenario = {}
    for i, row in enumerate(summary.rows):
        tally = Tally(**row.model_dump(exclude={"method", "scenario"}))
        _check_tally(tally, summary_source, i)
        tally_by_scenario[row.method, row.scenario] = tally
    tally_by_fault_type = {}
    for i, coverage_row in enumerate(coverage.rows):
        fault_type = f"{coverage_row.module}/{coverage_row.fault_type}"
        for method, activated, hazards in (
            ("guided", coverage_row.guided_activated, coverage_row.guided_hazards),
            ("random", coverage_row.random_activated, coverage_row.random_hazards),
        ):
            tally = Tally(injected=coverage_row.injected, activated=activated, hazards=hazards)
            _check_tally(tally, coverage_source, i)
            tally_by_fault_type[method, fault_type] = tally
    return PublishedNumbers(
        tally_by_scenario=tally_by_scenario,
        tally_by_fault_type=tally_by_fault_type,
        driver_reaction_s=times.driver_reaction_s,
        least_mean_alert_to_hazard_s=times.mean_alert_to_hazard_s.least,
        most_mean_alert_to_hazard_s=times.mean_alert_to_hazard_s.most,
    )


def has_published_numbers(references: Path) -> bool:
    return all((references / name).is_file() for name in PUBLISHED_FILE_NAMES)


def _check_tally(tally: Tally, source: YamlSource, row_index: int) -> None:
    """Raise MutatorError if a part exceeds its whole, or if counts of hazards and alerts are inconsistent."""
    parts = (tally.manifested or 0, tally.hazards, tally.alerts or 0)
    is_consistent = tally.activated <= tally.injected and max(parts) <= tally.activated
    if tally.alerts is not None:
        hazards_with_alert = tally.hazards - (tally.hazards_no_alerts or 0)
        is_consistent = is_consistent and hazards_with_alert == tally.alerts - (tally.alerts_no_hazards or 0)
    if not is_consistent:
        raise source.error(
            ("rows", row_index),
            f"counts that contradict each other: {tally}",
            expected="no count larger than one that includes it",
            remedy="compare with the published table",
        )
