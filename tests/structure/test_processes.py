"""What the processes of a run load."""

import subprocess
import sys

PROCESSES = (
    "mutator.execution.pytest_plugin",
    "mutator.execution.xdist_worker",
    "mutator.execution.cluster.piece_process",
    "mutator.serve.job_guard",
    "mutator.engines.in_target.fork_server",
    "mutator.engines.in_target.run_once",
)
READERS = ("pydantic", "pydantic_core", "yaml", "mutator.config.yaml_files", "mutator.workspace")
"""What reads the library's YAML. It takes longer to load than all the rest of a worker."""


def loaded_by(modules: tuple[str, ...]) -> set[str]:
    code = f"import sys, {', '.join(modules)}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_workers_and_target_processes_load_no_reader_of_yaml() -> None:
    assert not loaded_by(PROCESSES).intersection(READERS)


def test_a_command_that_reads_the_library_loads_them() -> None:
    assert set(READERS) <= loaded_by(("mutator.workspace",))
