"""Compare the times of a campaign between this version and an older one.

`python benchmarks/against.py CLONE [--campaign NAME]`. CLONE is a checkout of the older commit, installed
into its .venv as its README says. Both versions run alternately, each time with an empty cache. Code that an
old version compiles with a separate command is compiled before the measurement. CPU time covers all
processes. Wall times are meaningful only on otherwise idle cores. Idle time is the time in which a core has
no work.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
HELPERS = ("-m", "selfdrive.sim.compile_helpers")
WHOLE = "whole"
STAGES = ("planning", "checks", "golden runs", "experiments", "proof", "tables", "pictures", "report")
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")

Parts = dict[str, dict[str, float]]  # by stage: wall_s, cpu_s


def run(clone: Path, campaign: str, workers: int, more: list[str]) -> Parts:
    """Run a campaign with the version in `clone` and empty caches. Return the times of each stage."""
    python = sys.executable if clone == ROOT else str(clone / ".venv" / "bin" / "python")
    with tempfile.TemporaryDirectory() as place:
        # older versions ignore XDG_CACHE_HOME for frames, detections and helpers
        env = os.environ | {"HOME": place, "XDG_CACHE_HOME": f"{place}/.cache"}
        if clone != ROOT:
            compile_helpers(python, clone, env)
        command = [python, "-m", "mutator", "run", campaign, "--out", f"{place}/run"]
        command += ["-n", str(workers), *more]
        return followed(command, clone, env)


def compile_helpers(python: str, clone: Path, env: dict[str, str]) -> None:
    """Compile the helpers of an older version into the cache that its runs use."""
    command, env = [python, *HELPERS], env | {"PYTHONPATH": str(clone / "target")}
    said = subprocess.run([*command, "--help"], env=env, capture_output=True, text=True)
    if "--cache" in said.stdout:
        subprocess.run(command, env=env, check=True, stdout=sys.stderr)


def followed(command: list[str], folder: Path, env: dict[str, str]) -> Parts:
    """Return the time of each stage, from the line that names it to the next stage's line."""
    parts = {stage: {"wall_s": 0.0, "cpu_s": 0.0} for stage in STAGES}
    stage, line, since, used = STAGES[0], "", time.monotonic(), 0.0

    def ended(cpu: float) -> None:
        nonlocal since, used
        now = time.monotonic()
        parts[stage]["wall_s"] += now - since
        parts[stage]["cpu_s"] += cpu - used
        since, used = now, cpu

    with subprocess.Popen(
        command, cwd=folder, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            begun = next((name for name in STAGES if line.startswith(name)), stage)
            if begun != stage:
                ended(cpu_of(process.pid))
                stage = begun
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        ended(usage.ru_utime + usage.ru_stime)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)}: {line.strip()}")
    whole = {key: sum(part[key] for part in parts.values()) for key in ("wall_s", "cpu_s")}
    return parts | {WHOLE: whole}


def cpu_of(root: int) -> float:
    """Return the CPU time (s) of a process and its descendants, including those that have ended."""
    children: dict[int, list[int]] = defaultdict(list)
    used: dict[int, float] = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:  # it has just ended
            continue
        pid = int(path.parent.name)
        children[int(fields[1])].append(pid)
        used[pid] = TICK_S * sum(map(int, fields[11:15]))
    todo, total = [root], 0.0
    while todo:
        pid = todo.pop()
        total += used.get(pid, 0.0)
        todo += children[pid]
    return total


def show(parts: dict[str, Parts], workers: int) -> None:
    print(f"{'':14}" + "".join(f"{name:>9} wall s    CPU s   idle s" for name in parts) + "     CPU ratio")
    for stage in (*STAGES, WHOLE):
        cells = ""
        for took in parts.values():
            wall_s, cpu_s = took[stage]["wall_s"], took[stage]["cpu_s"]
            cells += f"{wall_s:16.1f}{cpu_s:9.1f}{workers * wall_s - cpu_s:9.1f}"
        older, this = (took[stage]["cpu_s"] for took in parts.values())
        print(f"{stage:14}{cells}" + (f"{this / older:14.2f}" if older else ""))


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("clone", type=Path, help="checkout of the older commit")
    parser.add_argument("--campaign", default="paper_sample")
    parser.add_argument("--limit", metavar="N", help="run only N experiments of the campaign")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    more = ["--limit", options.limit] if options.limit else []
    clones = {"older": options.clone.resolve(), "this": ROOT}
    figures: dict[str, list[Parts]] = {name: [] for name in clones}
    for number in range(options.rounds):
        for name in clones if number % 2 == 0 else reversed(clones):
            took = run(clones[name], options.campaign, options.workers, more)
            figures[name].append(took)
            whole = took[WHOLE]
            print(f"{name:8}{whole['wall_s']:9.1f} s wall {whole['cpu_s']:9.1f} s CPU", flush=True)
    middle = {
        name: {
            stage: {key: median(one[stage][key] for one in runs) for key in ("wall_s", "cpu_s")}
            for stage in (*STAGES, WHOLE)
        }
        for name, runs in figures.items()
    }
    show(middle, options.workers)
    for key, words in (("cpu_s", "CPU"), ("wall_s", "wall time")):
        older, this = (took[WHOLE][key] for took in middle.values())
        print(f"{words}: {older:.1f} s, now {this:.1f} s: ratio {this / older:.2f}")
    if options.json:
        options.json.write_text(json.dumps({"campaign": options.campaign, "runs": figures}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
