"""The run folders of sets of defences: `defended/<set>` in that of the undefended run, with the same plan.

Each is an ordinary run folder of a target whose tree has the defences of the set.
"""

import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from mutator._common.bounded_reading import MOST_EXPERIMENT_DATA_BYTES, read_bounded
from mutator._common.confined_files import not_plain_error, path_below
from mutator._common.files import make_folder, write_atomic
from mutator._common.folder_locks import lock_run_folder
from mutator.campaigns.plan_freezing import collect_target_facts, make_run_folder
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import check_sources, check_version
from mutator.defences.defence_facts import DefenceFacts, set_name
from mutator.errors import MutatorError
from mutator.model import GoldenClass
from mutator.store import file_digests, plan_file
from mutator.store.allowed_contents import DEFENDED_FOLDER
from mutator.store.file_digests import DigestLedger, FileDigest
from mutator.store.planned_scenarios import SCENARIOS_FILE
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE, HEAD, RunHead
from mutator.workspace import Workspace

_PLAN_FILES = (
    CAMPAIGN_FILE,
    "plan.csv",
    plan_file.EXPERIMENTS_FILE,
    plan_file.FAULTS_FILE,
    SCENARIOS_FILE,
)


def defended_run_path(run: Path, names: tuple[str, ...]) -> Path:
    """Return the folder of a set of defences in the run folder of the undefended run."""
    return path_below(run / DEFENDED_FOLDER, set_name(names))


def list_defended_runs(run: Path) -> list[Path]:
    """Return the run folders of sets of defences in a run folder, by name; UnsafePath for a link."""
    folder = run / DEFENDED_FOLDER
    if folder.is_symlink():
        raise not_plain_error(folder)
    if not folder.is_dir():
        return []
    with os.scandir(folder) as entries:
        listed = sorted(entries, key=lambda entry: entry.name)
    for entry in listed:
        if not entry.is_dir(follow_symlinks=False):
            raise not_plain_error(Path(entry.path))
    return [path for path in (Path(entry.path) for entry in listed) if RunFolder.exists(path)]


def open_or_freeze_defended_run(
    workspace: Workspace, undefended: RunFolder, names: tuple[str, ...]
) -> RunFolder:
    """Open the run folder of a set of defences, or make it; the caller owns it.

    MutatorError if it has another plan than the undefended run, or other sources.
    """
    out = defended_run_path(undefended.path, names)
    if RunFolder.exists(out):
        folder = RunFolder.open(out)
        check_version(folder)
        for problem in plan_problems(folder, undefended):
            raise problem
    else:
        folder = _freeze(workspace, undefended, names, out)
    inputs = RunInputs.of_run(workspace, folder)
    check_sources(out, folder.head.sources, inputs.digest_by_source())
    return folder


def freeze_defended_runs(
    workspace: Workspace, undefended: RunFolder, sets: Iterable[tuple[str, ...]]
) -> None:
    """Make the run folders of sets of defences that are not there yet; MutatorError as in
    `open_or_freeze_defended_run`.
    """
    for names in sets:
        out = defended_run_path(undefended.path, names)
        make_run_folder(out)
        with lock_run_folder(out):
            open_or_freeze_defended_run(workspace, undefended, names)


def plan_problems(folder: RunFolder, undefended: RunFolder) -> Iterator[MutatorError]:
    """Yield how the plan of a defended run differs from that of the undefended run, and whether its defences
    are those of its folder's name.
    """
    if (name := set_name(tuple(defence.name for defence in folder.head.defences))) != folder.path.name:
        yield MutatorError(
            f"the defences {name or 'none'}",
            where=folder.path / HEAD,
            expected=f"{folder.path.name}, as the folder's name",
            remedy="restore the folder's name, or delete the folder and run the campaign again",
        )
    for key in ("plan", "campaign_digest", "limits", "seed", "reading"):
        value, expected = (getattr(run.head, key) for run in (folder, undefended))
        if value != expected:
            yield MutatorError(
                f"{key} {value}",
                where=folder.path / HEAD,
                expected=f"{expected}, as in the undefended run",
                remedy="delete the folder of the set, and run the campaign again",
            )


def _freeze(workspace: Workspace, undefended: RunFolder, names: tuple[str, ...], out: Path) -> RunFolder:
    ledger = file_digests.load_ledger(undefended.path)
    files: dict[str, FileDigest] = {}
    for name in _PLAN_FILES:
        if name in ledger.files:
            data = read_bounded(path_below(undefended.path, name), MOST_EXPERIMENT_DATA_BYTES)
            make_folder(path_below(out, name).parent)
            write_atomic(path_below(out, name), data)
            files[name] = FileDigest.of_bytes(data)
    head = _defended_head(workspace, undefended.head, names)
    files[HEAD] = FileDigest.of_bytes(head.file_bytes())
    file_digests.save_ledger(out, DigestLedger(files=files))
    folder = RunFolder(out.resolve())
    vars(folder)["head"] = head  # the cached property, for the inputs
    inputs = RunInputs.of_run(workspace, folder)
    data = replace(head, sources=inputs.digest_by_source()).file_bytes()
    file_digests.save_ledger(out, DigestLedger(files=files | {HEAD: FileDigest.of_bytes(data)}))
    write_atomic(out / HEAD, data)  # last, because this file makes the folder a run folder
    return RunFolder.open(out)


def _defended_head(workspace: Workspace, head: RunHead, names: tuple[str, ...]) -> RunHead:
    facts = tuple(DefenceFacts.of_defence(workspace.defence(name)) for name in names)
    head = replace(
        head,
        defences=facts,
        stretches=(),
        # a hazard that a defence causes without a fault must not leave pairs without a result
        include=GoldenClass.HAZARD_WITHOUT_FAULT,
    )
    return replace(head, **vars(collect_target_facts(workspace, workspace.manifest_of(head))))
