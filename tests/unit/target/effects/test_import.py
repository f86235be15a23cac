import subprocess
import sys
from pathlib import Path

TARGET = Path(__file__).parents[4] / "target"
SCRIPT = """
import sys
import selfdrive.sim.run, selfdrive.sim.picture_camera, selfdrive.sim.image_library
import selfdrive.visiond.paper_detector, selfdrive.visiond.robust_detector
print([name for name in sys.modules if "sim.effects" in name])
"""


def test_fault_free_runs_do_not_import_effects():
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=TARGET, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
