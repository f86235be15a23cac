"""Every reader of a whole file has a limit (`mutator/_common/bounded_reading.py`)."""

import ast
from collections.abc import Iterator
from pathlib import Path

MUTATOR = Path(__file__).parents[2] / "mutator"
UNBOUNDED = ("read_bytes", "read_text", "readlines")
ALLOWED = {
    "_common/cpu_cores.py: read_text": "the kernel's file",
    "_common/shipped_files.py: read_bytes": "installed with the harness, or unpacked from that",
    "_common/shipped_files.py: read_text": "installed with the harness",
    "campaigns/run_environment.py: read_text": "the kernel's file",
    "execution/requested_campaigns.py: read_text": "the user's own pyproject.toml, which pytest reads, too",
    "execution/suspended_workers.py: read_text": "the kernel's file",
    "execution/worker_processes.py: read": "a file of its parent",
    "glue.py: read_text": "runs in the target's process",
    "results/table_reader.py: read": "checks the number of cells before",
    "review/image_effect_pictures.py: read_bytes": "installed with the harness",
    "review/image_effect_pictures.py: read_text": "installed with the harness",
    "store/series_packing.py: read": "calls a function of its own",
    "web/__init__.py: read_text": "installed with the harness",
}
ELSEWHERE = ("engines/in_target/", "reference/")  # in the target's process; for developers


def unbounded() -> Iterator[str]:
    for path in sorted(MUTATOR.rglob("*.py")):
        name = path.relative_to(MUTATOR).as_posix()
        if name.startswith(ELSEWHERE):
            continue
        for node in ast.walk(ast.parse(path.read_bytes())):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            called = node.func.attr
            if called in UNBOUNDED or (called == "read" and not node.args):
                yield f"{name}: {called}"


def test_files_are_read_with_a_limit() -> None:
    assert sorted({*unbounded()} - ALLOWED.keys()) == []


def test_every_exception_is_needed() -> None:
    assert sorted(ALLOWED.keys() - {*unbounded()}) == []
