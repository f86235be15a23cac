"""Measure the cost of a million experiments without their runs.

`python benchmarks/million.py [--sizes N ...] [--keep DIR]`. It measures plan, tables, resume, report and page
at three sizes. The runs are synthetic (`made_up_run.py`) and kept in DIR for later calls. Each row is
measured in a separate process: CPU and wall seconds, and the peak memory of the process and its children,
sampled twice a second. Shared pages count once. The page opens in a headless Chromium; its wall time ends
when its list is usable. Growth is the CPU time per experiment relative to that of the smallest size. `new
here` means a machine that has not verified the run before; afterwards only its bytes are compared.
"""

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, sleep

import made_up_run
import report_page
from playwright.sync_api import sync_playwright

from mutator.execution.campaign_running import run_campaign
from mutator.report import report_builder
from mutator.results import table_building
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

SIZES = (10_000, 100_000, 1_000_000)
GOAL_SIZE = 1_000_000
GOALS = {  # maximum wall s and MB for GOAL_SIZE
    "plan": (60.0, 1000.0),
    "table": (60.0, 2000.0),
    "resume": (10.0, None),
    "report": (180.0, 3000.0),
    "page": (3.0, None),
}


def plan(size: int, run: Path) -> None:
    with tempfile.TemporaryDirectory(dir=run.parent) as place:
        made_up_run.planned(Workspace.find(root=made_up_run.ROOT), size, Path(place) / "run")


def opened(size: int, run: Path) -> None:
    RunFolder.open(run)


def resume(size: int, run: Path) -> None:
    """Repeat the command when there is nothing left to do."""
    summary = run_campaign(Workspace.find(root=made_up_run.ROOT), run / "campaign.yaml", run)
    if summary.done < size or summary.ran:
        raise SystemExit(f"the run was not finished: {summary.ran} experiments ran now")


def table(size: int, run: Path) -> None:
    table_building.build_tables(run)


def report(size: int, run: Path) -> None:
    written = report_builder.write_report(run, Workspace.find(root=made_up_run.ROOT))
    if written.rows < size:
        raise SystemExit(f"the report has only {written.rows} experiments")


def page(size: int, run: Path) -> float:
    """Open the report's page and return the seconds until its list is usable."""
    with sync_playwright() as playwright:
        browser = report_page.launched(playwright)
        times = report_page.opened(
            browser, run / "report" / "index.html", 1, steps={}
        )  # measures only how the page opens
        browser.close()
    return times["open_ms"] / 1000


ROWS: dict[str, Callable[[int, Path], float | None]] = {
    **{"plan": plan, "open, new here": opened, "open": opened, "table": table},
    **{"resume, new here": resume, "resume": resume, "report": report, "page": page},
}


def apart(row: str, size: int, run: Path) -> dict[str, float]:
    command = [sys.executable, __file__, "--row", row, str(size), str(run)]
    cache = run.parent / "cache"
    if row == "open, new here":
        shutil.rmtree(cache, ignore_errors=True)
    environment = os.environ | {"XDG_CACHE_HOME": str(cache.resolve())}
    most = 0.0
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as running:
        while running.poll() is None:
            most = max(most, sum(map(memory_mb, family(running.pid))))
            sleep(0.5)
        told = running.stdout.read() if running.stdout else ""
    if running.returncode:
        raise SystemExit(running.returncode)
    found = dict(json.loads(told.splitlines()[-1]))
    return found | {"mb": max(most, found["mb"])}


def family(pid: int) -> list[int]:
    try:
        told = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")]
    except OSError:  # it has ended
        return []
    return [pid, *(one for text in told for child in text.split() for one in family(int(child)))]


def memory_mb(pid: int) -> float:
    """Return the memory (MB) of a process, including its share of shared pages."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024


def measured(row: str, size: int, run: Path) -> dict[str, float]:
    """Do a row's work and return the seconds and the peak memory (MB) of its process."""
    began = perf_counter()
    told = ROWS[row](size, run)
    wall = perf_counter() - began if told is None else told
    uses = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    cpu = sum(use.ru_utime + use.ru_stime for use in uses)
    return {"cpu_s": cpu, "wall_s": wall, "mb": max(use.ru_maxrss for use in uses) / 1024}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--keep", type=Path, help="keep the runs in this folder, and reuse its runs")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--row", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        row, size, run = options.row
        print(json.dumps(measured(row, int(size), Path(run))))
        return 0
    place = options.keep or Path(tempfile.mkdtemp())
    try:
        found = figures(options.sizes, options.rows, place)
    finally:
        if options.keep is None:
            shutil.rmtree(place)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n")
    return told(found)


def figures(sizes: list[int], rows: list[str], place: Path) -> dict[str, dict[int, dict[str, float]]]:
    found: dict[str, dict[int, dict[str, float]]] = {row: {} for row in rows}
    print(f"{'experiments':>12} {'':18}{'CPU s':>9}{'wall s':>9}{'MB':>8}{'us CPU each':>13}{'growth':>8}")
    for size in sizes:
        run = place / str(size)
        if not (run / "run.json").exists() or not RunFolder.open_unverified(run).is_finished:
            shutil.rmtree(run, ignore_errors=True)
            subprocess.run([sys.executable, made_up_run.__file__, str(size), str(run)], check=True)
        for row in rows:
            one = found[row][size] = apart(row, size, run)
            first = found[row][sizes[0]]["cpu_s"] / sizes[0]
            each = one["cpu_s"] / size
            print(
                f"{size:12,} {row:18}{one['cpu_s']:9.1f}{one['wall_s']:9.1f}{one['mb']:8.0f}"
                f"{each * 1e6:13.1f}{each / first:8.2f}",
                flush=True,
            )
    return found


def told(found: dict[str, dict[int, dict[str, float]]]) -> int:
    """Print the missed goals. Return 1 if there are any."""
    code = 0
    for row, (seconds, memory) in GOALS.items():
        one = found.get(row, {}).get(GOAL_SIZE)
        if one and (one["wall_s"] > seconds or (memory and one["mb"] > memory)):
            print(f"{row}: {one['wall_s']:.1f} s and {one['mb']:.0f} MB; the goal is {seconds:.0f} s", end="")
            print(f" and {memory:.0f} MB" if memory else "")
            code = 1
    return code


if __name__ == "__main__":
    sys.exit(main())
