"""The rows that one campaign of the study adds to the tables, computed from its run folder."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from mutator.audit.run_digests_and_seal import seals_of
from mutator.outcomes.fault_free_runs import latest_end_by_scenario, load_fault_free_runs
from mutator.paper import observation_judging
from mutator.paper.fault_type_rank_agreement import GUIDED, measure_agreement
from mutator.paper.observation_judging import JudgedObservation, combined_verdict, judge_observations
from mutator.paper.observations_by_seed import judge_by_seed
from mutator.paper.published_numbers import PublishedNumbers, load_published_numbers
from mutator.paper.reproduction.explaining_counts import count_runs
from mutator.paper.reproduction.study_campaigns import StudyCampaign
from mutator.paper.reproduction.study_tables import Row, tally_cells
from mutator.paper.verdict_margins import describe_observation_margin, smallest_change
from mutator.results.table_reader import Results
from mutator.statistics.results_frame import load_usable_results
from mutator.statistics.seed_spread_tables import ALL_FAULTS, seeds_sheet
from mutator.statistics.statistics_sheet import cell_text
from mutator.statistics.tallies import tally_by_fault_type, tally_by_scenario
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

if TYPE_CHECKING:
    import pandas as pd

ALL_TYPES, WITHOUT_FRAMES = "all", "without camera frames"
_FRAMES_MODULE = "vision_input"
_LEAST_RANKED = 3  # fault types


def rows_of_campaign(
    campaign: StudyCampaign, folder: RunFolder, workspace: Workspace, commit: str, tables_commit: str
) -> dict[str, list[Row]]:
    """Return the rows of each table, apart from those about the data set. The experiments were driven at
    `commit`; this code is of `tables_commit`.
    """
    frame = load_usable_results(Results.up_to_date(folder.path).run / "results.csv")
    references = workspace.references
    published = load_published_numbers(references)
    manifest = workspace.manifest_of(folder.head)
    ends = latest_end_by_scenario(folder, manifest)
    frame = frame.assign(t_end=frame["scenario"].map(ends))
    kinds = {kind for _, kind in published.tally_by_fault_type}
    judged = judge_observations(
        references / observation_judging.FILE_NAME, frame, _gaps(frame, kinds, folder.head.experiments)
    )
    by_seed = judge_by_seed(
        references / observation_judging.FILE_NAME, frame, lambda runs: _gaps(runs, kinds, len(runs))
    )
    name = campaign.name
    tables: dict[str, list[Row]] = {
        "runs": [_run_row(campaign, folder, commit, tables_commit)],
        "fault_types": [
            {"campaign": name, "method": method, "fault_type": kind, **tally_cells(tally)}
            for (method, kind), tally in tally_by_fault_type(frame).items()
        ],
        "scenarios": [
            {"campaign": name, "method": method, "scenario": scenario, **tally_cells(tally)}
            for (method, scenario), tally in tally_by_scenario(frame).items()
        ],
        "alerts": list(_alert_rows(name, frame)),
        "alerts_by_fault_type": list(_alert_rows_by_fault_type(name, frame)),
        "fault_free": [
            {
                "campaign": name,
                "seed": str(folder.head.seed if run.seed is None else run.seed),
                "scenario": run.scenario,
                "changes": " ".join(run.changes),
                "hazards": " ".join(hazard for hazard, _ in run.hazards),
                "alerts": " ".join(f"{alert} at {time:.2f} s" for alert, time in run.alerts),
            }
            for run in load_fault_free_runs(folder, manifest)
        ],
        "explaining_counts": []
        if campaign.is_sample
        else [{"campaign": name, "what": what, "count": count} for what, count in count_runs(frame)],
        "agreement": [] if campaign.is_sample else list(_agreement_rows(name, frame, published)),
        "claims": list(_claim_rows(name, judged)),
        "observations": [
            {
                "campaign": name,
                "observation": str(each.number),
                "title": each.title,
                "verdict": each.verdict.value,
                "on_paper": _verdict_on_paper(each),
                "change": describe_observation_margin(each),
            }
            for each in judged
        ],
        "observations_by_seed": [
            {
                "campaign": name,
                "seed": seed,
                "observation": str(each.number),
                "verdict": each.verdict.value,
                "change": describe_observation_margin(each),
            }
            for seed, observations in by_seed.items()
            for each in observations
        ],
        "seeds": list(_seed_rows(name, frame)) if campaign.is_sample else [],
    }
    return tables


def _gaps(frame: "pd.DataFrame", kinds: set[str], planned: int) -> list[str]:
    """Return how runs differ from the paper's mixture of faults."""
    gaps = [f"no runs of {kind}" for kind in sorted(kinds - set(frame["kind"].unique()))]
    return gaps + (
        [f"only {len(frame)} of {planned} experiments have a result"] if len(frame) < planned else []
    )


def _run_row(campaign: StudyCampaign, folder: RunFolder, commit: str, tables_commit: str) -> Row:
    seals, environments = seals_of(folder), folder.session_environments
    packages = {name: version for each in environments for name, version in each.packages.items()}
    return {
        "campaign": campaign.name,
        "title": campaign.title,
        "commit": commit,
        "tables_commit": tables_commit,
        "experiments": str(folder.head.experiments),
        "plan": folder.head.plan,
        "seal": seals.seal or "",
        "results_digest": seals.results_digest or "",
        "python": ", ".join(sorted({each.python for each in environments})),
        "mutator": folder.head.provenance.mutator,
        "packages": " ".join(f"{name}=={version}" for name, version in sorted(packages.items())),
    }


def _alert_rows(campaign: str, frame: "pd.DataFrame") -> Iterator[Row]:
    """Yield in how many runs with an activated fault each alert was raised, at any time after it."""
    for (method, scenario), runs in frame[frame["is_alert"]].groupby(["method", "scenario"], observed=True):
        counts = Counter(alert for alerts in runs["alerts"] for alert in dict.fromkeys(alerts.split(";")))
        for alert, count in sorted(counts.items()):
            yield {
                "campaign": campaign,
                "method": str(method),
                "scenario": str(scenario),
                "alert": alert,
                "runs": str(count),
            }


def _alert_rows_by_fault_type(campaign: str, frame: "pd.DataFrame") -> Iterator[Row]:
    guided = frame[(frame["method"] == GUIDED) & frame["is_activated"]]
    for (scenario, kind), runs in guided.groupby(["scenario", "kind"], observed=True):
        yield {
            "campaign": campaign,
            "scenario": str(scenario),
            "fault_type": str(kind),
            "activated": str(len(runs)),
            "alerts": str(int(runs["is_alert"].sum())),
        }


def _agreement_rows(campaign: str, frame: "pd.DataFrame", published: PublishedNumbers) -> Iterator[Row]:
    for label, runs in ((ALL_TYPES, frame), (WITHOUT_FRAMES, frame[frame["module"] != _FRAMES_MODULE])):
        activated = runs[(runs["method"] == GUIDED) & runs["is_activated"]]
        if activated["kind"].nunique() < _LEAST_RANKED:
            continue
        agreement = measure_agreement(runs, published)
        yield {
            "campaign": campaign,
            "fault_types": label,
            "correlation": f"{agreement.correlation:.2f}",
            "low": f"{agreement.low:.2f}",
            "high": f"{agreement.high:.2f}",
            "tied_here": str(agreement.tied_here),
            "tied_in_paper": str(agreement.tied_there),
        }


def _claim_rows(campaign: str, judged: Sequence[JudgedObservation]) -> Iterator[Row]:
    for observation in judged:
        for claim in observation.claims:
            for answer in claim.answers:
                rule, measure = claim.claim.claim_rule, claim.claim.measure
                margin = smallest_change(rule, answer.estimate, measure) if rule and measure else None
                yield {
                    "campaign": campaign,
                    "observation": str(observation.number),
                    "observation_verdict": observation.verdict.value,
                    "claim": claim.number,
                    "says": claim.claim.claim_text,
                    "needed": "yes" if claim.claim.needed else "",
                    "group": answer.group,
                    "estimate": answer.estimate.text,
                    "rule": str(rule or ""),
                    "verdict": answer.verdict.value,
                    "claim_verdict": claim.verdict.value,
                    "change": f"{margin.verdict.value}: {margin.text}" if margin else "",
                }


def _verdict_on_paper(observation: JudgedObservation) -> str:
    """Return the rules' verdict on the paper's counts, of the claims that have counts."""
    verdicts = [claim.verdict_on_paper for claim in observation.claims if claim.claim.needed]
    decided = [verdict for verdict in verdicts if verdict is not None]
    return combined_verdict(decided).value if decided else ""


def _seed_rows(campaign: str, frame: "pd.DataFrame") -> Iterator[Row]:
    for faults, part, whole, share, *cells, _ in seeds_sheet(frame).lines:
        if faults == ALL_FAULTS:
            low, high, least, its, largest, other = map(cell_text, cells)
            yield {
                "campaign": campaign,
                "share": f"{part} / {whole}",
                "all_seeds": cell_text(share),
                "between_seeds": f"{low} to {high}" if (low, high) != ("-", "-") else "equal in all seeds",
                "least": f"{least} (seed {its})",
                "largest": f"{largest} (seed {other})",
            }
