"""Frames, detections and traces have the same bytes on every Python and processor, and with compiled code."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from selfdrive.sim.compile_helpers import compile_helpers, compiler_command

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
RECORDED = HERE.parent / "fixtures" / "arithmetic.json"
PROCESSORS = {
    "as it is": {},
    "narrower vectors": {"NPY_DISABLE_CPU_FEATURES": "X86_V3"},
    "another kernel of BLAS": {"OPENBLAS_CORETYPE": "Prescott"},
}


@pytest.mark.parametrize("processor", PROCESSORS)
@pytest.mark.parametrize("code", ["plain", "compiled"])
def test_digests_equal_the_recorded_ones(processor: str, code: str, tmp_path: Path) -> None:
    """After an intended change of results, record them with `python tests/differential/arithmetic.py`."""
    command = [sys.executable, str(HERE / "arithmetic.py")]
    if code == "compiled":
        if not compiler_command():
            pytest.skip("there is no C compiler")
        list(compile_helpers(tmp_path))
        command.append(str(tmp_path))
    environment = os.environ | PROCESSORS[processor] | {"PYTHONPATH": str(HERE.parents[1] / "target")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    recorded, found = json.loads(RECORDED.read_text()), json.loads(done.stdout)
    assert [name for name in recorded | found if recorded.get(name) != found.get(name)] == []
