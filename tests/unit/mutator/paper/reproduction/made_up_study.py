"""A study with made-up tables: each campaign has the paper's counts."""

from pathlib import Path

from mutator.paper.published_numbers import load_published_numbers
from mutator.paper.reproduction.page_rendering import StudyPages
from mutator.paper.reproduction.study_campaigns import STUDY, StudyCampaign
from mutator.paper.reproduction.study_tables import Row, StudyTables, combined, tally_cells

CLONE = Path(__file__).parents[5]
PUBLISHED = load_published_numbers(CLONE / "fault_library" / "references")
COMMIT = "ab" * 20


def made_up_rows(
    campaign: StudyCampaign, commit: str = COMMIT, tables_commit: str = ""
) -> dict[str, list[Row]]:
    name = {"campaign": campaign.name}
    run = {"title": campaign.title, "commit": commit, "tables_commit": tables_commit or commit}
    run |= {"experiments": "11280", "plan": "p"}
    versions = {"python": "3.11", "mutator": "0", "packages": "numpy==2"}
    verdict = {"verdict": "holds", "change": "1.1: 5 instead of 4"}
    return {
        "runs": [name | run | {"seal": campaign.name, "results_digest": "r"} | versions],
        "fault_types": [
            name | {"method": method, "fault_type": kind} | tally_cells(tally)
            for (method, kind), tally in PUBLISHED.tally_by_fault_type.items()
        ],
        "scenarios": [
            name | {"method": method, "scenario": scenario} | tally_cells(tally)
            for (method, scenario), tally in PUBLISHED.tally_by_scenario.items()
        ],
        "alerts": [name | {"method": "guided", "scenario": "S2", "alert": "fcw", "runs": "7"}],
        "alerts_by_fault_type": [
            name | {"scenario": "S2", "fault_type": "radar/chaff", "activated": "9", "alerts": "4"}
        ],
        "fault_free": [
            name | {"seed": seed, "scenario": "S2", "changes": "", "hazards": "", "alerts": "fcw at 2.00 s"}
            for seed in "12"[: campaign.seed_count]
        ],
        "explaining_counts": [name | {"what": "speed, slower: hazards", "count": "4 of 9"}],
        "agreement": [
            name
            | {"fault_types": "all", "correlation": "0.86", "low": "0.5", "high": "0.9"}
            | {"tied_here": "2", "tied_in_paper": "3"}
        ],
        "claims": [
            name
            | {
                "observation": "1",
                "observation_verdict": "holds",
                "claim": "1.1",
                "needed": "yes",
                "group": "",
            }
            | {"says": "Most raise none", "estimate": "57.3 %", "rule": "above 0.5", "claim_verdict": "holds"}
            | verdict
        ],
        "observations": [name | {"observation": "1", "title": "It fails.", "on_paper": "holds"} | verdict],
        "observations_by_seed": [name | {"seed": "3", "observation": "1"} | verdict],
        "seeds": [
            name
            | {"share": "hazards / activated", "all_seeds": "21 %", "between_seeds": "20 to 22 %"}
            | {"least": "20 % (seed 5)", "largest": "22 % (seed 2)"}
        ],
    }


def made_up_tables(commit: str = COMMIT, tables_commit: str = "") -> StudyTables:
    data_set: dict[str, list[Row]] = {"data_set": [{"file": "runs.csv", "bytes": "12", "sha256": "c" * 64}]}
    return combined([*(made_up_rows(campaign, commit, tables_commit) for campaign in STUDY), data_set])


def made_up_pages(commit: str = COMMIT) -> StudyPages:
    return StudyPages(tables=made_up_tables(commit), campaigns=STUDY, published=PUBLISHED)
