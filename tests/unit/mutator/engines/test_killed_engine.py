"""A killed engine takes its run with it."""

import signal
import subprocess
import sys
import time
from pathlib import Path

from mutator.workspace import Workspace

from .ended_processes import ended

SLEEPER = """
import sys
from pathlib import Path
from mutator.engines.engine_jobs import Job
from mutator.engines.reference_engine import ReferenceEngine
from mutator.limits import (Limits)
from mutator.workspace import Workspace
library, templates, folder, note = map(Path, sys.argv[1:])
toycar = Workspace(library=library, templates=templates)
engine = ReferenceEngine(toycar.manifest("toycar"), folder / "work", Limits())
body = f"import os, pathlib, time; pathlib.Path({str(note)!r}).write_text(str(os.getpid())); time.sleep(60)"
job = Job(name="x", scenario=toycar.scenario("A"), seed=1, changed_files={"toycar/go.py": body.encode()})
engine.execute(job, folder / "work" / "x")
"""


def test_a_run_ends_when_its_engine_is_killed(toycar: Workspace, tmp_path: Path) -> None:
    note = tmp_path / "pid"
    (tmp_path / "work").mkdir()
    arguments = [toycar.library, toycar.templates, tmp_path, note]
    engine = subprocess.Popen([sys.executable, "-c", SLEEPER, *map(str, arguments)])
    try:
        deadline = time.monotonic() + 30.0
        while not (note.exists() and note.read_text()) and time.monotonic() < deadline:
            time.sleep(0.02)
        pid = int(note.read_text())
        assert not ended_now(pid)
    finally:
        engine.send_signal(signal.SIGKILL)
        engine.wait()
    assert ended(pid)


def ended_now(pid: int) -> bool:
    return not Path(f"/proc/{pid}").exists()
