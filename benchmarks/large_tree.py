"""Measure what files that no run imports cost `mutator check --drive`: `python benchmarks/large_tree.py`.

The small tree is that of the tests' library; the large one has 750 more files, of the standard library.
Rounds alternate. Times are CPU times of all processes.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from itertools import islice
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "tests" / "fixtures" / "run" / "toy"
MODULES, MODULES_GLOB = "toycar/**/*.py", "unused/**/*.py"
FILE_COUNT = 750
GOAL_S = 2.0  # more than for the small tree
LARGEST_FILE_BYTES = 1_000_000  # that a target can have


def copy_library(folder: Path) -> Path:
    """Copy the tests' library, without the faults that stop a run or the check."""
    shutil.copytree(LIBRARY, folder)
    shutil.rmtree(folder / "fault_library" / "faults" / "hostile")
    (folder / "fault_library" / "campaigns" / "hostile.yaml").unlink()
    for name in ("crash", "hang", "hoard", "leave", "segfault", "unsound"):
        for path in (folder / "templates").glob(f"{name}.*"):
            path.unlink()
    return folder


def add_unused_files(folder: Path) -> None:
    library = Path(sysconfig.get_path("stdlib"))
    sources = (
        path
        for path in sorted(library.rglob("*.py"))
        if path.is_file() and "site-packages" not in path.parts and path.stat().st_size < LARGEST_FILE_BYTES
    )
    for source in islice(sources, FILE_COUNT):
        copy = folder / "tree" / "unused" / source.relative_to(library)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, copy)
    manifest = folder / "fault_library" / "targets" / "toycar.yaml"
    manifest.write_text(manifest.read_text().replace(f'"{MODULES}"', f'"{MODULES}", "{MODULES_GLOB}"'))


def check_cpu_s(folder: Path) -> float:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(folder / "cache")}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "mutator", "check", "--drive"],
        cwd=folder,
        env=environment,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5, metavar="N")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        small, large = copy_library(Path(scratch, "small")), copy_library(Path(scratch, "large"))
        add_unused_files(large)
        more = []
        for _ in range(options.rounds):
            small_s, large_s = check_cpu_s(small), check_cpu_s(large)
            more.append(large_s - small_s)
            print(f"small tree {small_s:.1f} s, with {FILE_COUNT} more files {large_s:.1f} s")
    print(f"{median(more):.1f} s more (at most {GOAL_S:.0f} s)")
    return int(median(more) > GOAL_S)


if __name__ == "__main__":
    sys.exit(main())
