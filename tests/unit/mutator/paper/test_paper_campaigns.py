"""The paper campaigns have the counts of the paper's table III."""

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.campaigns.plan import Plan, build_plan
from mutator.model import Experiment, Method
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace

ROOT = Path(__file__).parents[4]
INJECTED = {  # column "injected" of table III, for the guided campaign and for the random one
    ("radar", "chaff"): 480,
    ("radar", "invisible_vehicle"): 120,
    ("radar", "ghost_vehicle"): 620,
    ("radar", "jamming"): 20,
    ("car_sensors", "speed"): 240,
    ("car_sensors", "steer"): 200,
    ("vision_input", "rain"): 200,
    ("vision_input", "fog"): 200,
    ("vision_input", "snow"): 200,
    ("vision_input", "occlusion"): 200,
    ("vision_input", "contrast"): 200,
    ("vision_input", "brightness"): 200,
    ("vision_input", "blur"): 180,
    ("vision_output", "camera_unavailable"): 20,
    ("vision_output", "path_model"): 600,
    ("vision_output", "relative_distance"): 980,
    ("radar_vision", "relative_distance"): 980,
}
SCENARIOS = {"S1", "S2", "S3", "S4", "S5"}


@pytest.fixture(scope="module")
def library() -> Workspace:
    return Workspace.find(root=ROOT)


@pytest.fixture(scope="module")
def paper(library: Workspace) -> Plan:
    return build_plan(library, "paper")


@pytest.fixture(scope="module")
def sample(library: Workspace) -> Plan:
    return build_plan(library, "paper_sample")


def kinds(plan: Plan, method: Method) -> Counter[tuple[str, str]]:
    return Counter((e.fault.module, e.fault.fault_type) for e in plan.experiments if e.method is method)


def pair(experiment: Experiment) -> tuple[str, str, str]:
    row = experiment.trigger.name.removeprefix("random/")
    return experiment.scenario, experiment.fault.id, row


def of_method(plan: Plan, method: Method, key: Callable[[Experiment], object]) -> set[object]:
    return {key(e) for e in plan.experiments if e.method is method}


def test_the_paper_campaigns_have_the_counts_of_table_three(paper: Plan) -> None:
    for method in Method:
        counts = kinds(paper, method)
        assert counts == INJECTED
        assert counts.total() == 5640
    assert len({e.id for e in paper.experiments}) == 11_280


def test_each_value_is_injected_in_each_scenario_and_context(paper: Plan) -> None:
    guided = of_method(paper, Method.GUIDED, pair)
    assert guided == of_method(paper, Method.RANDOM, pair)
    faults = {e.fault.id for e in paper.experiments}
    assert len(faults) == 282
    contexts = ("C1", "C2", "C3", "C4")
    assert guided == {(s, f, c) for s in SCENARIOS for f in faults for c in contexts}


@pytest.mark.parametrize("method", Method)
def test_the_campaign_of_each_method_is_half_of_the_paper_campaign(
    library: Workspace, paper: Plan, method: Method
) -> None:
    half = build_plan(library, f"paper_{method.value}")
    assert [e.id for e in half.experiments] == [e.id for e in paper.experiments if e.method is method]
    assert {e.setting for e in half.experiments} == {("pictures", "paper_detector")}


def test_the_as_coded_campaign_has_the_same_counts(library: Workspace) -> None:
    coded = build_plan(library, "paper_guided", Choices(reading="as_coded"))
    assert kinds(coded, Method.GUIDED) == INJECTED
    assert {e.trigger.armed_after_s for e in coded.experiments} == {0.0}
    assert {e.setting for e in coded.experiments} == {("pictures", "coded_detector")}


def test_the_sample_is_a_tenth_of_the_paper_campaign(paper: Plan, sample: Plan) -> None:
    assert len(sample.experiments) == 1128
    assert {e.id for e in sample.experiments} <= {e.id for e in paper.experiments}
    assert of_method(sample, Method.GUIDED, pair) == of_method(sample, Method.RANDOM, pair)
    cells = Counter((e.fault.module, e.fault.fault_type, e.scenario, e.method) for e in sample.experiments)
    assert set(cells) == {(*kind, s, m) for kind in INJECTED for s in SCENARIOS for m in Method}
    for (module, kind, _, _), number in cells.items():
        assert abs(number - max(INJECTED[module, kind] / 50, 1.0)) <= 1.0


def test_the_smoke_campaign_has_every_scenario_and_variant(library: Workspace, paper: Plan) -> None:
    smoke = build_plan(library, "paper_smoke").experiments
    assert len(smoke) == 113
    assert {e.id for e in smoke} <= {e.id for e in paper.experiments}
    assert of_method(paper, Method.GUIDED, lambda e: e.fault.spec) == {e.fault.spec for e in smoke}
    assert {(e.scenario, e.method) for e in smoke} == {(s, m) for s in SCENARIOS for m in Method}


def test_the_reference_campaign_uses_the_reading_as_coded(library: Workspace) -> None:
    plan = build_plan(library, "paper_reference")
    assert kinds(plan, Method.GUIDED) == kinds(plan, Method.RANDOM) == INJECTED
    setting = ("pictures", "reference_plant", "coded_detector", "coded_translation")
    settings = {(e.setting, e.fault.reading) for e in plan.experiments}
    assert settings == {(setting, "as_coded")}


@pytest.mark.slow
def test_the_plan_is_the_same_in_another_process(sample: Plan) -> None:
    code = (
        "from pathlib import Path; from mutator.campaigns.plan import build_plan;"
        "from mutator.store.plan_choices import Choices;"
        "from mutator.workspace import Workspace;"
        f"print(build_plan(Workspace.find(root=Path({str(ROOT)!r})), 'paper_sample').digest)"
    )
    env = os.environ | {"PYTHONHASHSEED": "99", "LC_ALL": "C", "TZ": "Asia/Tokyo"}
    made = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
    assert made.stdout.strip() == sample.digest
    assert build_plan(Workspace.find(root=ROOT), "paper_sample", Choices(seed=2)).digest != sample.digest
