"""CPU time of what happens around the experiments of the paper's 11,280: plan, freeze, resume when complete.

`python benchmarks/planning.py`. The complete run is made up: every experiment has a record of a masked fault.
"""

import tempfile
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from time import process_time
from typing import Any

from mutator import campaign_run
from mutator.model import Experiment, Outcome, Record, Status
from mutator.plan import freeze, make_plan
from mutator.records import SCHEMA, LineWriter
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[1]


def timed(name: str, work: Callable[[], Any]) -> Any:
    began = process_time()
    done = work()
    print(f"{name:18} {process_time() - began:5.2f} s")
    return done


def masked(experiment: Experiment) -> Record:
    return Record(
        experiment_id=experiment.id,
        status=Status.OK,
        outcome=Outcome.MASKED,
        detail="",
        tree="",
        activation=None,
        t_manifest=None,
        max_dev=(("gas", 0.0), ("brake", 0.0), ("steer_torque", 0.0)),
        hazards=(),
        alerts=(),
        trace_digest="",
    )


def main() -> None:
    workspace = Workspace.find(root=ROOT)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        plan = timed("plan", lambda: make_plan(workspace, "paper"))
        timed("freeze", lambda: freeze(plan, out, workspace))
        lines = LineWriter(out / "records" / "0001-main.jsonl", {"schema": SCHEMA, "plan": plan.digest})
        for experiment in plan.experiments:
            lines.append(asdict(masked(experiment)))
        lines.close()
        timed("tables", lambda: campaign_run.run(workspace, "paper", out))
        timed("resume, complete", lambda: campaign_run.run(workspace, "paper", out))


if __name__ == "__main__":
    main()
