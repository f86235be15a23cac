"""On the shipped controller, the engines give the same records, and no run falls back to the reference
engine."""

from collections import Counter
from pathlib import Path

import pytest

from mutator.campaigns.plan import build_plan
from mutator.engines.engine_choice import make_engine
from mutator.engines.engine_jobs import EngineArguments, Job
from mutator.engines.engine_kinds import ENGINES
from mutator.engines.reference_engine import ReferenceEngine
from mutator.execution.experiment_runner import ExperimentRunner
from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.model import Record
from mutator.store.golden_runs import GoldenRun
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[2]


@pytest.mark.slow
@pytest.mark.parametrize(("campaign", "limit"), [("quickstart", 26), ("paper", 8)])
def test_the_engines_give_the_same_records(tmp_path: Path, campaign: str, limit: int) -> None:
    clone = Workspace.find(root=CLONE)
    plan = build_plan(clone, campaign, Choices(limit=limit))
    manifest, models = clone.manifest("openpilot"), clone.fault_models()
    (tmp_path / "work").mkdir()
    limits = plan.campaign.limits
    reference = ReferenceEngine(manifest, tmp_path / "work", limits)
    outputs: dict[str, Path] = {}
    for one in plan.goldens():
        job = Job(
            name=one.key, scenario=clone.scenario(one.scenario), seed=plan.seed, scenario_changes=one.changes
        )
        outputs[one.key] = reference.execute(job, tmp_path / one.key).out
    goldens = LoadedGoldens(manifest, lambda e: outputs[GoldenRun.for_experiment(e, several_seeds=False).key])
    found: dict[str, dict[str, Record]] = {}
    for name in ENGINES:
        work = tmp_path / name
        work.mkdir()
        setting = EngineArguments(manifest=manifest, models=models, work_folder=work, limits=limits)
        engine = make_engine(name, setting)
        done = list(ExperimentRunner(manifest, models, engine, goldens, clone.scenario).run(plan.experiments))
        engine.close()
        found[name] = {finished.experiment.id: finished.record for finished in done}
        assert Counter(finished.fallback_reason for finished in done) == {"": len(plan.experiments)}
    assert found["fork"] == found["reference"]
    assert found["warm"] == found["reference"]
