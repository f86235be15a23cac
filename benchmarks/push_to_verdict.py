"""Measure the CPU from a push to the verdict of the gate, for `quickstart` with a warm store.

`python benchmarks/push_to_verdict.py [--pairs 5] [--only NAME]`, in Python 3.12 or later. A push runs the
steps of action.yml from the fetched base to the comparison, with the run of the base and the environment as
a runner restores them from its caches. It alternates with the same change in `mutator run` and
`mutator compare`. A change that no experiment executes is compared with planning, checks and golden runs, any
other one with all of `mutator run` and the comparison. The CPU time is that of all processes.
"""

import argparse
import resource
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from pull_requests import make_repository  # noqa: E402

from tests.github_runner import STEPS, Runner, build_runner, git  # noqa: E402

CAMPAIGN = "quickstart"
FIRST_STEP, LAST_STEP = "Fetch the base", "Compare"
# what `mutator run` does before its experiments; it does the checks beside them
BEFORE_EXPERIMENTS = """\
import sys
from pathlib import Path
from mutator.execution.session_opening import open_session
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace
workspace, out = Workspace.find(), Path(sys.argv[2])
campaign = workspace.campaign(sys.argv[1])
with open_session(workspace, campaign, out, workers=2, choices=Choices(), reuse=False) as session:
    session.prepare(checks_beside=False)
"""


@dataclass(frozen=True)
class Push:
    """A change: `text` with the number of the push is added to a file. `goal`: most CPU over its rival's."""

    name: str
    path: str
    text: str
    is_executed: bool
    goal: float


PUSHES = (
    Push("not executed", "selfdrive/sim/scenario_page.py", "\nPUSH = {}\n", False, 1.1),
    Push("executed by all", "selfdrive/controls/controlsd.py", "\nPUSH = {}\n", True, 1.2),
)


def commit_push(push: Push, number: int, repository: Path) -> None:
    """Commit the change on a branch of its own. No two trees are equal, so the store has no results of it."""
    git(repository, "checkout", "--quiet", "-B", "push", "origin/main")
    path = repository / "target" / push.path
    path.write_text(path.read_text() + push.text.format(number))
    git(repository, "commit", "--quiet", "--all", "-m", f"{push.name} {number}")


def cpu_of_children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def cpu_of_push(runner: Runner) -> float:
    """Run the steps up to the verdict; return the CPU time (s) of their processes."""
    names = [step.get("name") for step in STEPS]
    steps = STEPS[names.index(FIRST_STEP) : names.index(LAST_STEP) + 1]
    before = cpu_of_children()
    for step in steps:
        if "run" in step and runner.should_run(step.get("if", "success()"), 0) and runner.run_step(step):
            sys.exit(runner.log)
    return cpu_of_children() - before


def cpu_of_commands(repository: Path, environment: dict[str, str], *commands: list[str]) -> float:
    """Return the CPU time (s) of Python with these arguments, one after the other."""
    before = cpu_of_children()
    for command in commands:
        subprocess.run(
            [sys.executable, *command],
            cwd=repository,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=True,
        )
    return cpu_of_children() - before


def cpu_of_rival(push: Push, repository: Path, base: Path, environment: dict[str, str]) -> float:
    """Return the CPU time (s) of what the push is compared with, on the same kind of change."""
    new = base.with_name("by-hand")
    run = ["-m", "mutator", "run", CAMPAIGN, "--out", str(new), "-n", "2", "--no-stills", "--no-reuse"]
    compare = ["-m", "mutator", "compare", str(base), str(new), "--out", str(new / "comparison")]
    begin = ["-c", BEFORE_EXPERIMENTS, CAMPAIGN, str(new)]
    commands = [run, compare] if push.is_executed else [begin]
    cpu_s = cpu_of_commands(repository, environment, *commands)
    shutil.rmtree(new)
    return cpu_s


def measure_pair(push: Push, number: int, repository: Path, runner: Runner) -> float:
    """Measure a push and its rival, in changing order; return their ratio."""
    runs = runner.temp / "mutator-runs" / CAMPAIGN
    cpu_s: dict[bool, float] = {}
    for is_push in (True, False) if number % 2 == 0 else (False, True):
        commit_push(push, 2 * number + is_push, repository)
        if is_push:
            shutil.rmtree(runs / "new")
            cpu_s[is_push] = cpu_of_push(runner)
        else:
            environment = runner.environment | {"PYTHONPATH": str(ROOT)}
            cpu_s[is_push] = cpu_of_rival(push, repository, runs / "base", environment)
    print(f"{push.name}: {cpu_s[True]:.1f} s from push to verdict, {cpu_s[False]:.1f} s by hand", flush=True)
    return cpu_s[True] / cpu_s[False]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--only", choices=[push.name for push in PUSHES])
    options = parser.parse_args()
    if sys.version_info < (3, 12):
        print("needs Python 3.12 or later, where runs note what they execute")
        return 1
    is_over = False
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        repository = make_repository(place)
        runner = build_runner(repository, place)
        commit_push(PUSHES[0], -1, repository)
        inputs = {"campaign": CAMPAIGN, "base": "main", "workers": "2"}
        if runner.run(inputs):  # fills store and environment, and makes the run of the base
            sys.exit(runner.log)
        runner.context["steps.base-run.outputs.cache-hit"] = "true"
        for push in PUSHES:
            if options.only not in (None, push.name):
                continue
            ratios = [measure_pair(push, number, repository, runner) for number in range(options.pairs)]
            over = median(ratios)
            is_over = is_over or over > push.goal
            print(f"{push.name}: {over:.2f} times (goal: at most {push.goal})", flush=True)
    return int(is_over)


if __name__ == "__main__":
    sys.exit(main())
