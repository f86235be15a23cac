"""Checks of the strata of a run's sample, which its seal does not cover."""

import warnings
from collections.abc import Iterator
from dataclasses import replace

from mutator.campaigns.plan import Plan, build_plan
from mutator.errors import MutatorError, MutatorWarning
from mutator.store.plan_strata import STRATA_FILE, PlanStrata, load_strata
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE
from mutator.workspace import Workspace


def planned_strata_problems(folder: RunFolder, plan: Plan) -> Iterator[MutatorError]:
    """Yield a problem for each stratum that is smaller than what was drawn from it."""
    strata = load_strata(folder.path)
    if strata is None:
        return
    drawn = PlanStrata.of_experiments(strata.draw, plan.experiments).size_by_stratum
    for stratum, count in drawn.items():
        if (size := strata.size_by_stratum.get(stratum, 0)) < count:
            yield MutatorError(
                f"{size} experiments of {', '.join(stratum)}",
                where=folder.path / STRATA_FILE,
                expected=f"at least {count}, which the plan has",
            )


def drawn_strata_problems(folder: RunFolder, workspace: Workspace) -> Iterator[MutatorError]:
    """Yield a problem if planning the campaign again gives other strata.

    Nothing is compared if it gives another plan, because a fault spec has changed since.
    """
    strata = load_strata(folder.path)
    if strata is None:
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MutatorWarning)  # planning has shown them
        choices = replace(folder.head.choices, shard=None)
        plan = build_plan(workspace, folder.path / CAMPAIGN_FILE, choices)
    if plan.digest == folder.head.plan and plan.strata != strata:
        yield MutatorError(
            f"strata of {strata.experiment_count} experiments",
            where=folder.path / STRATA_FILE,
            expected="those of the campaign before the draw",
        )
