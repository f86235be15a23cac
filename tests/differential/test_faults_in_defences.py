"""A fault in a defence makes it prevent nothing."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.execution.campaign_running import run_campaign
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

CopyToycar = Callable[[Path], Workspace]
MODEL = """\
class Model:
    def __init__(self, *, level, highest_gas):
        self.level = level
        self.gas = highest_gas

    def reset(self):
        pass

    def update(self, since_s, sensed, applied):
        level = self.level
        return {"brake": (level, float("inf")), "gas": (0.0, self.gas)}
"""
SPEC = """\
schema: fault_spec/1
module: sensor
fault_type: blind
about: The sensor is wrong, and the emergency brake does not brake.
variants:
  both:
    aim: H1
    about: The other car seems far away, and the brake fails.
    as_described:
      injections:
        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: gap}
          model: offset
          unit: m
          params: {by_m: 60}
        - at: {defence: emergency_brake, function: Model.update, after_assign: level}
          model: stuck
          unit: "1"
          params: {target: level, value: 0.0}
"""


@pytest.mark.parametrize("engine", ["fork", pytest.param("reference", marks=pytest.mark.slow)])
def test_a_fault_in_a_defence_makes_it_prevent_nothing(
    copy_toycar: CopyToycar, tmp_path: Path, engine: str
) -> None:
    """In the undefended tree, the fault has only its other injection; both runs have the same experiments."""
    workspace = copy_toycar(tmp_path)
    (workspace.templates / "defences" / "own.py").write_text(MODEL)
    (workspace.library / "faults" / "sensor" / "blind.yaml").write_text(SPEC)
    path = workspace.defences["emergency_brake"]
    text = path.read_text().replace("constant_command", "own").replace("lowest_brake", "level")
    path.write_text(text)
    campaign = workspace.campaign("defended")
    text = campaign.read_text().replace(", [pedal_limit, emergency_brake]", "")
    campaign.write_text(text.replace("spec: sensor/silence/no_data", "spec: sensor/blind/both"))
    run = tmp_path / "run"
    assert run_campaign(workspace, "defended", run, engine=engine).exit_code == 0
    folders = [RunFolder.open(each) for each in (run, run / "defended" / "emergency_brake")]
    undefended, defended = (folder.records() for folder in folders)
    blind = {
        e.id
        for e in plan_file.load_experiments(run)
        if e.fault.spec == "sensor/blind/both" and "H1" in dict(undefended[e.id].hazards)
    }
    assert blind
    for name in blind:
        assert "H1" in dict(defended[name].hazards)
        assert b"_fd_emergency_brake" in (folders[1].read_patch(name, defended[name]) or b"")
        assert b"_fd" not in (folders[0].read_patch(name, undefended[name]) or b"")
