"""A family of scenarios of the toy car, and edits of scenarios in a run folder."""

import json
from pathlib import Path

from mutator._common.files import json_bytes
from mutator.store import file_digests
from mutator.store.file_digests import FileDigest
from mutator.store.planned_scenarios import SCENARIOS_FILE
from mutator.workspace import Workspace

FAMILY = """\
schema: family/1
name: follow
title: The lead ahead brakes gently
source: A test
parameters:
  ego_mps: {from: 14, to: 20, step: 1}
  gap_m: [30, 40]
  lead_mps: [18, 22]
constraints: [lead_mps > ego_mps - 3]
template: |
  steps: 120
  speed: {{ ego_mps }}
  gap: {{ gap_m }}
  lead_speed: {{ lead_mps }}
  lead_brakes: 0
"""


def with_family(toy: Workspace) -> Workspace:
    (toy.library / "families").mkdir()
    (toy.library / "families" / "follow.yaml").write_text(FAMILY)
    campaign = toy.library / "campaigns" / "toy.yaml"
    text = campaign.read_text().replace("[A, B]", "[A, {family: follow, sample: 3, sampling: sobol}]")
    campaign.write_text(text.replace("sample: 24", "sample: 16"))
    return toy


def forge_digests(run: Path) -> None:
    """Make run.json and digests.json match the file of scenarios, as somebody would who hides an edit."""
    head = json.loads((run / "run.json").read_text())
    head["scenarios"] = FileDigest.of_file(run / SCENARIOS_FILE).sha256
    (run / "run.json").write_bytes(json_bytes(head))
    ledger = file_digests.load_ledger(run)
    files = {name: FileDigest.of_file(run / name) for name in ledger.files}
    file_digests.save_ledger(run, file_digests.DigestLedger(files=files))
