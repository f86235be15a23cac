"""What a report says of each family of scenarios: its concrete scenarios, shares over them, and weights."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.errors import MutatorError
from mutator.families.family import Family
from mutator.families.family_facts import FamilyFacts
from mutator.families.scenario_sampling import frequency_weight, has_independent_draws
from mutator.model import ConcreteScenario
from mutator.report.reported_run import ReportedRun
from mutator.statistics.family_statistics import FamilyShare, family_shares, scenarios_frame
from mutator.statistics.fault_free_drive_tables import load_judged_drives
from mutator.statistics.results_frame import hazard_names
from mutator.store.file_digests import FileDigest
from mutator.store.planned_scenarios import concrete_scenarios_of
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilyResults:
    """A family of a run. `scenarios` are its rows of `scenarios_frame`; `frequency_source` says where the
    weights of its shares come from, '' without weights.
    """

    facts: FamilyFacts
    scenarios: "pd.DataFrame"
    shares: list[FamilyShare]
    frequency_source: str

    @property
    def experiment_count(self) -> int:
        return int(self.scenarios["experiments"].sum())


def results_by_family(run: ReportedRun) -> list[FamilyResults]:
    """Return the results of each family of a run, in the order of run.json."""
    families = run.folder.head.families
    scenarios = [*concrete_scenarios_of(run.folder.path).values()]
    if not families:
        return []
    frame = scenarios_frame(families, scenarios, run.frame, load_judged_drives(run.folder))
    results = []
    for facts in families:
        of_family = frame[frame["family"] == facts.name]
        family = _unchanged_family(run.folder, run.workspace, facts.name)
        weights = _weights(run.folder, family, [s for s in scenarios if s.family == facts.name])
        results.append(
            FamilyResults(
                facts=facts,
                scenarios=of_family,
                shares=family_shares(of_family, hazard_names(run.frame), weights),
                frequency_source=family.frequency.source
                if family and family.frequency and weights is not None
                else "",
            )
        )
    return results


def _unchanged_family(folder: RunFolder, workspace: Workspace | None, name: str) -> Family | None:
    """Return the family from the library; None if it is not there as it was when the run was planned."""
    try:
        family = workspace.family(name) if workspace else None
    except MutatorError:
        return None
    file_digest = FileDigest.of_file(family.path) if family else None
    is_same = file_digest and file_digest.sha256 == folder.head.sources.get(f"family {name}")
    return family if is_same else None


def _weights(
    folder: RunFolder, family: Family | None, scenarios: list[ConcreteScenario]
) -> np.ndarray | None:
    """Return the weight of each scenario: how often it occurs, relative to how often it is drawn. None
    without a `frequency`, in a bench, whose scenarios are not drawn, and if so many were drawn that likely
    ones are exhausted.
    """
    if family is None or family.frequency is None or folder.is_bench:
        return None
    selections = load_campaign_of_run(folder).scenario_selections
    method = next(
        (s.sampling for s in selections if not isinstance(s, str) and s.family == family.name), None
    )
    method = method or family.sampling
    if not has_independent_draws(family, len(scenarios), method):
        return None
    return np.array([frequency_weight(family, scenario.values, method) for scenario in scenarios])
