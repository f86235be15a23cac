"""A plan becomes a run folder: frozen, with what it was made from, so that it is run as it was planned."""

import csv
import io
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mutator._common.files import is_half_written, json_bytes, make_folder, write_atomic
from mutator._common.hashing import digest, plain
from mutator._common.locks import owned
from mutator._common.version import VERSION
from mutator.campaigns.plans import Plan
from mutator.campaigns.provenance import check_sources, check_version, sources
from mutator.errors import MutatorError
from mutator.outcomes.columns import PLAN_COLUMNS, metric_columns
from mutator.outcomes.propagation import channel_facts
from mutator.store import digests, plan_file
from mutator.store.digests import Digest, Ledger
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN, HEAD, SCHEMA
from mutator.workspace import Workspace

CSV = "plan.csv"
_OURS = ("owner.lock", "workers", "plan", CSV, CAMPAIGN, digests.FILE)  # what a killed freeze leaves


def freeze(plan: Plan, out: Path, workspace: Workspace) -> RunFolder:
    """Write the plan (and plan.csv) into the run folder `out`, made if missing.

    A folder that holds the same plan is left as it is; another plan, or other sources than it was frozen
    with, is a MutatorError, as is a folder in use or one that holds other things.
    """
    make_run_folder(out)
    with owned(out):
        return freeze_owned(plan, out, workspace)


def make_run_folder(out: Path) -> None:
    """Make `out` unless it is a run folder; MutatorError when it holds anything else."""
    if out.exists() and not RunFolder.exists(out):
        names = [path.name for path in out.iterdir()] if out.is_dir() else [out.name]
        strangers = [name for name in names if name not in _OURS and not is_half_written(name)]
        if strangers:
            raise MutatorError(
                f"no {HEAD}, and not empty ({', '.join(sorted(strangers)[:3])})",
                where=out,
                argument="out",
                expected="a run folder, or a new or empty folder",
                remedy="choose another `out`",
            )
    make_folder(out)


def freeze_owned(plan: Plan, out: Path, workspace: Workspace) -> RunFolder:
    """As `freeze`, by who owns the folder already."""
    if RunFolder.exists(out):
        folder = RunFolder.open(out)
        if folder.head["plan"] != plan.digest:
            raise MutatorError(
                "holds another plan",
                where=out,
                expected=f"plan {plan.digest[:16]}",
                remedy="use another folder, or the campaign and options it was planned with",
            )
        check_version(out, folder.head["schema"], folder.head["provenance"])
        check_sources(out, folder.head["sources"], _sources(plan, workspace))
        return folder
    write_atomic(out / CAMPAIGN, plan.campaign.source)
    write_atomic(out / CSV, plan_csv(plan))
    chunks = plan_file.write(out, plan.experiments, plan.chunks)
    head = json_bytes(_head(plan, workspace, chunks))
    written = (CAMPAIGN, CSV, plan_file.EXPERIMENTS, plan_file.FAULTS)
    files = {name: Digest.of((out / name).read_bytes()) for name in written}
    digests.write(out, Ledger(files=files | {HEAD: Digest.of(head)}))
    write_atomic(out / HEAD, head)  # last: from now on it is a run folder
    return RunFolder.open(out)


def _sources(plan: Plan, workspace: Workspace) -> dict[str, str]:
    scenarios = {scenario for scenario, _ in plan.goldens()}
    return sources(workspace, workspace.manifest(plan.campaign.target), scenarios)


def _head(plan: Plan, workspace: Workspace, chunks: list[plan_file.Chunk]) -> dict[str, Any]:
    manifest = workspace.manifest(plan.campaign.target)
    structure = workspace.structure(manifest)
    canary = plan_file.to_plain(plan.canary) | {"fault": plain(plan.canary.fault)}
    return {
        "schema": SCHEMA,
        "plan": plan.digest,
        "campaign": plan.campaign.name,
        "campaign_digest": digest(plan.campaign.source),
        "study": plan.campaign.study,
        "target": plan.campaign.target,
        "seed": plan.seed,
        "reading": plan.reading,
        "choices": asdict(plan.choices),
        "experiments": len(plan.experiments),
        "runs": plan.runs,
        "limits": plain(plan.campaign.limits),
        "hazards": list(manifest.hazards),
        "alerts": list(manifest.alerts),
        "compared": [channel.name for channel in manifest.compared],
        "metrics": metric_columns(manifest),
        "about_hazards": [
            {"name": one.name, "about": one.about, "terminal": bool(one.terminal)} for one in manifest.rules
        ],
        "severity": scale.plain() if (scale := workspace.scale_of(manifest)) else None,
        "channels": channel_facts(manifest),
        "structure": structure.model_dump(mode="json", by_alias=True) if structure else None,
        "goldens": [[scenario, list(changes)] for scenario, changes in plan.goldens()],
        "golden_files": list(manifest.outputs),
        "canary": canary,
        "canary_hazard": plan.campaign.canary.hazard,
        "sources": _sources(plan, workspace),
        "target_files": manifest.tree.digests,
        "provenance": {"mutator": VERSION},
        "stretches": [],
        "chunks": chunks,
    }


def plan_csv(plan: Plan) -> bytes:
    """What plan.csv holds."""
    writer = csv.DictWriter(text := io.StringIO(), PLAN_COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(plan.rows())
    return text.getvalue().encode()
