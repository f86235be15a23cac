"""Audit the runs of a campaign's sets of defences, which are in the folder of its undefended run."""

from collections.abc import Iterator

from mutator.audit.run_audit import AuditCheck, run_audit_checks
from mutator.audit.run_digests_and_seal import digests_or_why_no_seal
from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.defended_runs import defended_run_path, list_defended_runs, plan_problems
from mutator.defences.defence_facts import set_name
from mutator.errors import MutatorError
from mutator.store.allowed_contents import DEFENDED_FOLDER
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


def defended_run_checks(
    folder: RunFolder, workspace: Workspace | None, facts: dict[str, str]
) -> list[AuditCheck]:
    """Check each defended run as a run of its own, and that its plan and defences are those of the campaign.
    `facts` get the seals. No check for a run without sets of defences.
    """
    try:
        sets = load_campaign_of_run(folder).defence_sets
        paths = list_defended_runs(folder.path)
    except MutatorError as error:  # a damaged campaign is reported by other checks, too
        return [AuditCheck(checked_parts=DEFENDED_FOLDER, checked_count=0, differences=(error,))]
    checks = []
    names_by_path = {defended_run_path(folder.path, names): names for names in sets}
    for path in paths:
        if path not in names_by_path:
            extra = MutatorError("not a set of the campaign", where=path, remedy="delete the folder")
            checks.append(AuditCheck(checked_parts=path.name, checked_count=0, differences=(extra,)))
    for path, names in names_by_path.items():
        title = f"{DEFENDED_FOLDER}/{set_name(names)}"
        if path not in paths:
            facts[title] = "not run"
            continue
        run = RunFolder.open_unverified(path)
        problems = _problems(run, folder, workspace)
        checks.append(AuditCheck.from_problems(title, run.planned_experiment_count, problems))
        if not checks[-1].differences:
            facts |= {f"{title}, {name}": text for name, text in digests_or_why_no_seal(run).items()}
    return checks


def _problems(run: RunFolder, undefended: RunFolder, workspace: Workspace | None) -> Iterator[MutatorError]:
    yield from plan_problems(run, undefended)
    for check in run_audit_checks(run, workspace):
        yield from check.differences
