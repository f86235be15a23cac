"""Compare the reference, warm and fork engines on the same experiments of the paper's campaign.

`python benchmarks/engines.py [--experiments 200] [--json FILE] [--skip reference]`. Half of the experiments
are guided and half random. Times are CPU times (user and system) of this process and all its children. Golden
runs and the work done once for a campaign (loading the target, observing each golden run) are counted
separately. `--library DIR --campaign NAME` uses another library, such as an example whose steps cost almost
nothing.
"""

import argparse
import json
import resource
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from mutator.campaigns.plan import Plan, build_plan  # noqa: E402
from mutator.engines.engine_jobs import Engine, Job  # noqa: E402
from mutator.engines.fork_engine import ForkEngine  # noqa: E402
from mutator.engines.reference_engine import ReferenceEngine  # noqa: E402
from mutator.execution.experiment_runner import ExperimentRunner, RecordedExperiment  # noqa: E402
from mutator.execution.loaded_goldens import LoadedGoldens  # noqa: E402
from mutator.model import Experiment, Record  # noqa: E402
from mutator.mutants.mutant_building import build  # noqa: E402
from mutator.outcomes import trace_and_record_loading  # noqa: E402
from mutator.store.golden_runs import GoldenRun  # noqa: E402
from mutator.store.plan_choices import Choices  # noqa: E402
from mutator.triggers.trigger_kinds import always_trigger  # noqa: E402
from mutator.workspace import Workspace  # noqa: E402

GOAL_OF_WARM = 1.15  # fork's CPU / (warm's CPU x share of time after activation)
GOAL_OF_REFERENCE = 1 / 3


@dataclass
class Measured:
    cpu_s: float = 0.0
    children_s: float = 0.0  # of which the runs themselves
    steps: int = 0
    how: Counter[str] = field(default_factory=Counter)
    why: Counter[str] = field(default_factory=Counter)
    records: dict[str, Record] = field(default_factory=dict)


class Bench:
    def __init__(self, plan: Plan, workspace: Workspace, folder: Path) -> None:
        self.workspace, self.folder = workspace, folder
        self.manifest = workspace.manifest(plan.campaign.target)
        self.models = workspace.fault_models()
        self.plan = plan
        work = folder / "work"
        work.mkdir()
        null = build(self.manifest, self.models, None, always_trigger())
        arguments = (self.manifest, work, plan.campaign.limits)
        self.engines: dict[str, Callable[[], Engine]] = {
            "reference": lambda: ReferenceEngine(*arguments),
            "warm": lambda: ForkEngine(*arguments, null_mutant=null, before_first_step=True),
            "fork": lambda: ForkEngine(*arguments, null_mutant=null),
        }
        self._drive_goldens(ReferenceEngine(*arguments))

    def golden(self, experiment: Experiment) -> Path:
        return self.folder / "golden" / GoldenRun.for_experiment(experiment, several_seeds=False).key

    def steps(self, experiment: Experiment) -> int:
        """Return the number of steps of every run that ends normally."""
        trace = trace_and_record_loading.load_trace(self.manifest, self.golden(experiment))
        return len(trace[self.manifest.time_channel])

    def _drive_goldens(self, engine: ReferenceEngine) -> None:
        (self.folder / "golden").mkdir()
        for one in self.plan.goldens():
            job = Job(
                name=one.key,
                scenario=self.workspace.scenario(one.scenario),
                seed=self.plan.seed,
                scenario_changes=one.changes,
            )
            execution = engine.execute(job, engine.work_folder / job.name)
            execution.out.rename(self.folder / "golden" / one.key)

    def measure(self, name: str, experiments: Sequence[Experiment]) -> tuple[Measured, float]:
        """Return the measurements, and the CPU time (s) of a first pass over one experiment per golden
        run.
        """
        engine = self.engines[name]()
        runner = ExperimentRunner(
            self.manifest,
            self.models,
            engine,
            LoadedGoldens(self.manifest, self.golden),
            self.workspace.scenario,
        )
        firsts = {(e.scenario, e.changes): e for e in experiments}.values()
        before = _cpu()
        for key in firsts:
            list(runner.run([key]))
        engine.close()  # CPU time includes the engine's processes only once they have ended
        first_s = _cpu() - before
        before, measured = _cpu(), Measured()
        for finished in runner.run(sorted(experiments, key=lambda e: (e.scenario, e.changes, e.method))):
            self._take(measured, finished)
        engine.close()
        measured.cpu_s = _cpu() - before
        return measured, first_s

    def _take(self, measured: Measured, finished: RecordedExperiment) -> None:
        measured.records[finished.experiment.id] = finished.record
        measured.how[str(finished.mode)] += 1
        measured.why[finished.fallback_reason] += 1
        measured.children_s += finished.cpu_s
        if finished.mode != "golden":
            measured.steps += self.steps(finished.experiment) - finished.fork_step


def _cpu() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaign", default="paper")
    parser.add_argument(
        "--library", type=Path, metavar="DIR", help="another fault library, such as that of an example"
    )
    parser.add_argument("--experiments", type=int, default=200, metavar="N")
    parser.add_argument("--skip", action="append", default=[], choices=("reference", "warm", "fork"))
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args(arguments)
    workspace = Workspace.find(root=ROOT, library=options.library)
    plan = build_plan(workspace, options.campaign, Choices(limit=options.experiments))
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(plan, workspace, Path(folder))
        found: dict[str, Measured] = {}
        facts: dict[str, object] = {"campaign": options.campaign, "experiments": len(plan.experiments)}
        bench.measure("fork", plan.experiments)  # warms the target's caches for all engines
        for name in bench.engines:
            if name not in options.skip:
                found[name], first_s = bench.measure(name, plan.experiments)
                facts[name] = _told(name, found[name], first_s)
    facts |= _compared(found)
    if options.json:
        options.json.write_text(json.dumps(facts, indent=1) + "\n")
    return int(not facts["good"])


def _told(name: str, measured: Measured, first_s: float) -> dict[str, object]:
    count = len(measured.records)
    print(
        f"{name:10} {measured.cpu_s:8.2f} s CPU, {1e3 * measured.cpu_s / count:7.1f} ms an experiment "
        f"({1e3 * measured.children_s / count:.1f} in the runs), {measured.steps} steps, "
        f"{dict(measured.how)}; beforehand {first_s:.1f} s",
        flush=True,
    )
    for why, times in measured.why.items():
        if why:
            print(f"{'':10} {times} on the reference engine: {why}")
    return {
        "cpu_s": measured.cpu_s,
        "runs_cpu_s": measured.children_s,
        "steps": measured.steps,
        "how": dict(measured.how),
        "why": dict(measured.why),
        "beforehand_s": first_s,
    }


def _compared(found: dict[str, Measured]) -> dict[str, object]:
    records = [measured.records for measured in found.values()]
    facts: dict[str, object] = {"same": all(other == records[0] for other in records)}
    good = facts["same"]
    print(f"records are the same: {facts['same']}")
    if "fork" in found and "warm" in found:
        fork, warm = found["fork"], found["warm"]
        share = fork.steps / warm.steps
        ratio = fork.cpu_s / (warm.cpu_s * share)
        good = good and ratio <= GOAL_OF_WARM
        facts |= {"share": share, "fork_of_warm": ratio}
        print(f"simulated time that remains after activation: {share:.3f}")
        print(f"fork / (warm x share): {ratio:.3f} (at most {GOAL_OF_WARM})")
    if "fork" in found and "reference" in found:
        ratio = found["fork"].cpu_s / found["reference"].cpu_s
        good = good and ratio <= GOAL_OF_REFERENCE
        facts["fork_of_reference"] = ratio
        print(f"fork / reference: {ratio:.3f} (at most {GOAL_OF_REFERENCE:.3f})")
    return facts | {"good": good}


if __name__ == "__main__":
    sys.exit(main())
