"""Compare the CPU time of experiments that a bench is asked for in batches with that of one campaign.

`python benchmarks/batches.py [--experiments N] [--rounds N]`. The experiments are drawn from the paper's
campaign, without camera frames, in five scenarios. The ways alternate, the campaign being the first and the
last in turn, each in a process of its own, with checks that have passed before. CPU time covers the whole
process tree. A bench proves more experiments than a campaign, whatever its batches; so each way is also
compared with one batch of all experiments. It also prints how much memory the waiting processes of an open
bench take, and the CPU time of a trial of another value beside its run.
"""

import argparse
import json
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import mutator
from mutator.campaigns.shared_runs import order_for_sharing
from mutator.config.yaml_files import load_yaml
from mutator.config.yaml_writing import yaml_text
from mutator.store.timings import load_timings

ROOT = Path(__file__).resolve().parents[1]
CAMPAIGN, ONE_BATCH = "one campaign", "one batch"
GOALS = {"batches of 8": 1.05, "batches of 1": 1.05, "batches of 1, shuffled": 1.15}
SIZES = {"batches of 8": 8, "batches of 1": 1, "batches of 1, shuffled": 1}
MOST_WAITING_MB, MOST_TRIAL_S = 600.0, 0.3
TRIAL_COUNT = 10


def write_campaign_without_frames(folder: Path) -> Path:
    """Write the paper's campaign without what needs camera frames."""
    data = dict(load_yaml(ROOT / "fault_library" / "campaigns" / "paper.yaml").data)
    faults = [fault for fault in data["faults"] if not fault["spec"].startswith("vision_input/")]
    file = folder / "without_frames.yaml"
    file.write_text(
        yaml_text({key: value for key, value in data.items() if key != "setting"} | {"faults": faults})
    )
    return file


def ask(way: str, out: Path, count: int) -> dict[str, float]:
    """Run all experiments in one way. Return what is measured besides the CPU time."""
    campaign = write_campaign_without_frames(out.parent)
    choices = mutator.Choices(limit=count)
    if way == CAMPAIGN:
        mutator.run(campaign, out, choices=choices, engine="fork", reuse=False)
        return {}
    planned = mutator.plan(campaign, choices=choices).experiments
    experiments = [run[0] for run in order_for_sharing([[experiment] for experiment in planned])]
    if way.endswith("shuffled"):
        random.Random(1).shuffle(experiments)
    size, waiting_mb, asked_s, run_s = SIZES.get(way, count), 0.0, 0.0, 0.0
    with mutator.open_bench(None, out, campaign=campaign, seed=experiments[0].seed, reuse=False) as bench:
        for begin in range(0, count, size):
            bench.run(experiments[begin : begin + size])
            if begin % 50 == 0:
                waiting_mb = max(waiting_mb, memory_of_descendants_mb())
        if way == "batches of 1":
            for number in range(TRIAL_COUNT):
                began, used = cpu_of_tree(), cpu_of_runs(out)
                trial = bench.build_experiment(
                    "radar_vision/relative_distance/longer", "S1", 5.0, value=20.5 + number
                )
                bench.run([trial])
                asked_s += cpu_of_tree() - began
                run_s += cpu_of_runs(out) - used
    return {"waiting_mb": waiting_mb, "trial_s": (asked_s - run_s) / TRIAL_COUNT, "trials_s": asked_s}


def cpu_of_runs(out: Path) -> float:
    return sum(float(timing["cpu_s"]) for timing in load_timings(out).values())


def descendants(root: int) -> list[int]:
    found, todo = [], [root]
    while todo:
        pid = todo.pop()
        found.append(pid)
        for path in Path(f"/proc/{pid}/task").glob("*/children"):
            todo += map(int, path.read_text().split())
    return found


def cpu_of_tree() -> float:
    """Return the CPU time (s) of this process and its descendants, including those that have ended."""
    tick_s, total = 1.0 / os.sysconf("SC_CLK_TCK"), 0.0
    for pid in descendants(os.getpid()):
        try:
            fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:  # it has just ended
            continue
        total += tick_s * sum(map(int, fields[11:15]))
    return total


def memory_of_descendants_mb() -> float:
    """Return the memory of the worker and its waiting processes; what they share is counted once."""
    total = 0
    for pid in descendants(os.getpid())[1:]:
        try:
            text = Path(f"/proc/{pid}/smaps_rollup").read_text()
        except OSError:
            continue
        total += next(int(line.split()[1]) for line in text.splitlines() if line.startswith("Pss:"))
    return total / 1024.0


def measure(way: str, place: Path, count: int) -> dict[str, float]:
    """Run a way in a new process, and return its CPU time and what it measured."""
    with tempfile.TemporaryDirectory(dir=place) as folder:
        told = Path(folder) / "told.json"
        command = [sys.executable, __file__, "--way", way, "--experiments", str(count)]
        command += ["--out", str(Path(folder) / "run"), "--json", str(told)]
        env = os.environ | {"XDG_CACHE_HOME": str(place / "cache")}
        with subprocess.Popen(command, env=env, cwd=ROOT) as process:
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise SystemExit(f"{way} ended with {process.returncode}")
        values: dict[str, float] = json.loads(told.read_text())
        # the trials are no part of what the campaign runs
    return values | {"cpu_s": usage.ru_utime + usage.ru_stime - values.get("trials_s", 0.0)}


def bare_loop_s() -> float:
    """Return the CPU time of a fixed loop, the unit of absolute figures on a busy machine."""
    began = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    sum(i * i for i in range(2_000_000))
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime - began


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--experiments", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--way", help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    if options.way:
        values = ask(options.way, options.out, options.experiments)
        options.json.write_text(json.dumps(values))
        return 0
    taken: dict[str, list[dict[str, float]]] = {way: [] for way in (CAMPAIGN, ONE_BATCH, *GOALS)}
    with tempfile.TemporaryDirectory() as folder:
        for way in (CAMPAIGN, "batches of 8"):  # fill the caches
            measure(way, Path(folder), options.experiments)
        for number in range(options.rounds):
            # the machine can slow down or speed up during a round, so the campaign is first or last in turn
            for way in taken if number % 2 == 0 else reversed(taken):
                began = time.monotonic()
                taken[way].append(measure(way, Path(folder), options.experiments))
                measured = ", ".join(f"{name} {value:.2f}" for name, value in taken[way][-1].items())
                print(f"round {number + 1}, {way}: {measured}; {time.monotonic() - began:.0f} s", flush=True)
    return show(taken, options)


def median_ratio(taken: dict[str, list[dict[str, float]]], way: str, other_way: str) -> float:
    pairs = zip(taken[way], taken[other_way], strict=True)
    return median(one["cpu_s"] / other["cpu_s"] for one, other in pairs)


def show(taken: dict[str, list[dict[str, float]]], options: argparse.Namespace) -> int:
    """Print medians and ratios. Return 1 if a goal is missed."""
    missed = False
    each_s = median(one["cpu_s"] for one in taken[CAMPAIGN]) / options.experiments
    print(f"\n{CAMPAIGN}: {each_s:.3f} s CPU for each experiment; a bare loop takes {bare_loop_s():.2f} s")
    print(f"{ONE_BATCH}: {median_ratio(taken, ONE_BATCH, CAMPAIGN):.2f} times the campaign's")
    for way, goal in GOALS.items():
        ratio = median_ratio(taken, way, CAMPAIGN)
        missed |= ratio > goal
        print(
            f"{way}: {ratio:.2f} times the campaign's, goal {goal}; "
            f"{median_ratio(taken, way, ONE_BATCH):.2f} times one batch's"
        )
    waiting_mb = max(one["waiting_mb"] for way in GOALS for one in taken[way])
    trial_s = median(one["trial_s"] for one in taken["batches of 1"])
    print(f"waiting processes of a worker: {waiting_mb:.0f} MB, goal {MOST_WAITING_MB:.0f}")
    print(f"a trial of another value, beside its run: {trial_s:.2f} s CPU, goal {MOST_TRIAL_S}")
    if options.json:
        options.json.write_text(json.dumps(taken, indent=1))
    return int(missed or waiting_mb > MOST_WAITING_MB or trial_s > MOST_TRIAL_S)


if __name__ == "__main__":
    sys.exit(main())
