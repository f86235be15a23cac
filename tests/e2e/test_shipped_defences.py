"""What shipped defences do to drives with faults: one is prevented, one is caused, and a broken one prevents
nothing.
"""

import csv
import shutil
from pathlib import Path

import pytest

from mutator.execution.campaign_running import run_campaign
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

pytestmark = pytest.mark.slow

CLONE = Path(__file__).parents[2]
SPEC = """schema: fault_spec/1
module: proof
fault_type: far
about: Radar and camera report a distance that is too long.
variants:
"""
VARIANT = """  {name}:
    aim: H1
    about: A constant is added.
    phrase: radar and camera add {metres} m
    as_described:
      injections:
        - at: {{file: selfdrive/sim/radar.py, function: RadarSensor.measure, after_assign: d_rel}}
          model: offset
          unit: m
          params: {{by_m: {metres}}}
        - at: {{file: selfdrive/visiond/visiond.py, function: Visiond.update, after_assign: lead_d_rel}}
          model: offset
          unit: m
          params: {{by_m: {metres}}}
"""
BROKEN = """        - at: {defence: aeb_three_stage_own_sensor, function: Model.update, after_assign: lowest}
          model: stuck
          unit: mps2
          params: {value_mps2: 0}
"""
CAMPAIGN = """schema: campaign/1
name: proof
about: Proof.
target: openpilot
scenarios: [{scenario}]
faults: [{faults}]
methods: [guided]
triggers: {{list: [{trigger}]}}
defences: [none, {defence}]
seed: 1
canary: {{spec: vision_output/path_model/both, scenario: {scenario}, hazard: H3, at_s: 5.0}}
limits: {{cpu_s: 60, wall_s: 600, memory_mb: 4096, steps: 6000}}
"""

Rows = dict[str, dict[str, str]]


def rows_of(run: Path) -> Rows:
    return {row["variant"]: row for row in csv.DictReader((run / "results.csv").open())}


def drive(tmp_path: Path, scenario: str, trigger: str, defence: str, *variants: str) -> tuple[Rows, Rows]:
    """Run faults of the spec without and with a defence; return the rows of both by variant."""
    library = tmp_path / "fault_library"
    shutil.copytree(CLONE / "fault_library", library)
    text = SPEC + VARIANT.format(name="by_60", metres=60) + VARIANT.format(name="by_100", metres=100)
    text += VARIANT.format(name="broken", metres=60) + BROKEN
    (library / "faults" / "proof").mkdir()
    (library / "faults" / "proof" / "far.yaml").write_text(text)
    faults = ", ".join(f"{{spec: proof/far/{variant}}}" for variant in variants)
    (library / "campaigns" / "proof.yaml").write_text(
        CAMPAIGN.format(scenario=scenario, faults=faults, trigger=trigger, defence=defence)
    )
    workspace = Workspace.find(root=CLONE, library=library, target=CLONE / "target")
    run = tmp_path / "run"
    assert run_campaign(workspace, "proof", run, workers=2).exit_code == 0
    return rows_of(run), rows_of(run / "defended" / defence)


def test_a_broken_emergency_brake_prevents_nothing(tmp_path: Path) -> None:
    """The whole one prevents the contact; the broken one asks for no deceleration, and there is a contact."""
    undefended, defended = drive(
        tmp_path, "S4", "{at_s: 8.0}", "aeb_three_stage_own_sensor", "by_60", "broken"
    )
    assert {name: row["h1"] for name, row in undefended.items()} == {"by_60": "1", "broken": "1"}
    assert {name: row["h1"] for name, row in defended.items()} == {"by_60": "0", "broken": "1"}


def test_an_emergency_brake_can_cause_a_collision(tmp_path: Path) -> None:
    """Without it, the car comes near its lead, but does not touch it. With it, the car has braked without a
    need at 1.31 s, is still catching up when the fault comes, and hits the lead.
    """
    trigger = "{at_s: 18.0, hold_s: 7.5}"
    undefended, _ = drive(tmp_path, "S2", trigger, "aeb_three_stage_controller", "by_100")
    assert (undefended["by_100"]["outcome"], undefended["by_100"]["h1"]) == ("sdc", "0")
    assert float(undefended["by_100"]["smallest_gap"]) < 1.0
    folder = RunFolder.open(tmp_path / "run" / "defended" / "aeb_three_stage_controller")
    [record] = folder.records().values()
    # a fault that begins after golden's hazard is not judged, so that the contact is among golden's hazards
    hazards = dict((*record.hazards, *record.golden_hazards))
    assert hazards == {"H4": 1.81, "H1": pytest.approx(25.6, abs=0.2)}
