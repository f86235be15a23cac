"""Measure the cost of an experiment without its simulation.

`python benchmarks/overhead.py [--experiments 200] [--against CLONE] [--json FILE]`. The fork engine runs
faults of the paper's campaign with ideal vision, each of which first acts at a different time in the last
steps of a 30 s run. All of a worker's steps are included: mutant, run, comparison with the golden run, patch,
record. It prints the CPU of the worker, of its children and of the processes from which they fork, and the
CPU of 30 s of the same simulation. With `--against`, this version and a checkout of an older commit
alternate. Compare the ratios, not the times.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from itertools import cycle, islice
from pathlib import Path
from statistics import median
from time import process_time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mutator.campaigns.plan import build_plan  # noqa: E402
from mutator.engines.engine_jobs import Job  # noqa: E402
from mutator.engines.fork_engine import ForkEngine  # noqa: E402
from mutator.engines.reference_engine import ReferenceEngine  # noqa: E402
from mutator.execution.experiment_runner import ExperimentRunner  # noqa: E402
from mutator.execution.loaded_goldens import LoadedGoldens  # noqa: E402
from mutator.model import Experiment, Hold, Trigger  # noqa: E402
from mutator.mutants.mutant_building import build  # noqa: E402
from mutator.store.checksummed_lines import LineWriter  # noqa: E402
from mutator.store.plan_choices import Choices  # noqa: E402
from mutator.store.records import RECORDS_SCHEMA, record_as_json  # noqa: E402
from mutator.triggers.trigger_kinds import always_trigger  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

GOAL_MS = 5.0
GOAL_OF_OLDER = 0.65
END_S, LAST_STEPS, STEP_S = 30.0, 10, 0.01
SCENARIO = "S1"
FEW = 5  # first experiments, which do one-time work and are not measured


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """CPU time (s, user and system) of that many experiments."""

    worker: float
    children: float
    server: float


def late(workspace: Workspace, count: int) -> list[Experiment]:
    """Return faults of the campaign that leave the scenario unchanged and first act in the last steps."""
    plan = build_plan(workspace, "paper", Choices(limit=8 * count))
    known = {e.fault.id: e for e in plan.experiments if e.scenario == SCENARIO and not e.fault.changes}
    made = []
    for number, experiment in enumerate(islice(cycle(known.values()), count)):
        # no two triggers are equal, and each is later than the one before
        t = END_S - STEP_S * (1.5 + LAST_STEPS * (1 - (number + 1) / count))
        trigger = Trigger(name="late", condition=f"t >= {t:.9f}", hold=Hold.TO_END, armed_after_s=1.5)
        made.append(replace(experiment, trigger=trigger, setting=()))
    return made


class Bench:
    def __init__(self, workspace: Workspace, folder: Path) -> None:
        self.workspace, self.folder = workspace, folder
        self.manifest, self.models = workspace.manifest("openpilot"), workspace.fault_models()
        self.work = folder / "work"
        self.work.mkdir()
        limits = build_plan(workspace, "paper", Choices(limit=1)).campaign.limits
        self.common = (self.manifest, self.work, limits)

    def golden(self) -> tuple[Path, float]:
        """Return the output folder of a golden run, and its CPU time (s) minus that of a two-step run."""
        job = Job(name="golden", scenario=self.workspace.scenario(SCENARIO), seed=1)
        engine = ReferenceEngine(*self.common)
        whole = engine.execute(job, self.folder / "golden")
        few = replace(self.manifest, entry_args=(*self.manifest.entry_args, "--max-steps", "2"))
        short = ReferenceEngine(few, *self.common[1:]).execute(job, self.folder / "few")
        return whole.out, whole.cpu_s - short.cpu_s

    def cost(self, experiments: Sequence[Experiment], golden: Path) -> Cost:
        """Return the cost of the experiments without the first `FEW`. All must be forked."""
        null = build(self.manifest, self.models, None, always_trigger())
        engine = ForkEngine(*self.common, null_mutant=null)
        goldens = LoadedGoldens(self.manifest, lambda experiment: golden)
        runner = ExperimentRunner(self.manifest, self.models, engine, goldens, self.workspace.scenario)
        records = LineWriter(self.folder / "records.jsonl", {"schema": RECORDS_SCHEMA})

        def run(some: Sequence[Experiment]) -> float:
            children = 0.0
            for finished in runner.run(some):
                assert finished.mode == "fork" and finished.mutant, finished.record
                (self.folder / "patch").write_bytes(finished.mutant.patch_bytes)
                records.append(record_as_json(finished.record))
                children += finished.cpu_s
            return children

        run(experiments[:FEW])
        before, began = self._server(), process_time()
        children = run(experiments[FEW:])
        worker, after = process_time() - began, self._server()
        assert before.keys() <= after.keys()  # the time of an ended process would be lost
        records.close()
        engine.close()
        return Cost(worker=worker, children=children, server=sum(after.values()) - sum(before.values()))

    def _server(self) -> dict[str, float]:
        """Return the CPU time (s) of each process of the fork server, without its finished children."""
        found = {}
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                if str(self.work).encode() in (process / "cmdline").read_bytes():
                    found[process.name] = int((process / "schedstat").read_text().split()[0]) / 1e9
        return found


def against(clone: Path, options: argparse.Namespace) -> int:
    """Measure this version and the one in `clone` alternately. Return the exit code."""
    found: dict[str, list[dict[str, float]]] = {"older": [], "this": []}
    for number in range(options.rounds):
        for name in found if number % 2 == 0 else reversed(found):
            root = ROOT if name == "this" else clone.resolve()
            found[name].append(_told_by(root, options.experiments))
            print(f"{name:8} {found[name][-1]['all']:6.2f} ms of CPU an experiment", flush=True)
    ratios = {
        part: median(one[part] for one in found["this"]) / median(one[part] for one in found["older"])
        for part in found["this"][0]
    }
    print(*(f"{part} {ratio:.2f}" for part, ratio in ratios.items()), sep=", ", end="")
    print(f" of the older version's cost (goal for all: {GOAL_OF_OLDER})")
    if options.json:
        options.json.write_text(json.dumps({"ms": found, "ratios": ratios}, indent=1) + "\n")
    return int(ratios["all"] > GOAL_OF_OLDER)


def _told_by(root: Path, experiments: int) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "told.json"
        words = ["--experiments", str(experiments), "--json", str(told)]
        paths = os.pathsep.join([str(root), str(root / "target")])
        subprocess.run(
            [sys.executable, str(root / "benchmarks" / "overhead.py"), *words],
            env=os.environ | {"PYTHONPATH": paths},
            stdout=subprocess.DEVNULL,
            check=False,  # 1: over its goal
        )
        facts = json.loads(told.read_text())
    return {**facts["ms"], "all": facts["total_ms"]}


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--experiments", type=int, default=200, metavar="N")
    parser.add_argument("--against", type=Path, metavar="CLONE", help="checkout of an older commit")
    parser.add_argument("--rounds", type=int, default=3, help="rounds of both versions, with --against")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(arguments)
    if options.against:
        return against(options.against, options)
    workspace = Workspace.find(root=ROOT)
    known = late(workspace, options.experiments + FEW)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(workspace, Path(folder))
        golden, driving = bench.golden()
        cost = bench.cost(known, golden)
    count = options.experiments
    facts = {name: 1e3 * seconds / count for name, seconds in asdict(cost).items()}
    total = sum(facts.values())
    for name, ms in facts.items():
        print(f"{name:10} {ms:6.2f} ms of CPU an experiment")
    print(f"all        {total:6.2f} ms (goal {GOAL_MS}), {total / driving / 10:.2f} % of 30 s of driving")
    if options.json:
        told = {"experiments": count, "ms": facts, "total_ms": total, "driving_s": driving}
        options.json.write_text(json.dumps(told, indent=1) + "\n")
    return int(total > GOAL_MS)


if __name__ == "__main__":
    sys.exit(main())
