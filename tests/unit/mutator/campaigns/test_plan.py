"""The content and the reproducibility of plans."""

import shutil
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from mutator.campaigns.plan import Plan, build_plan
from mutator.errors import MutatorError
from mutator.model import Experiment, Hold, Method
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace


@pytest.fixture
def whole(toycar: Workspace) -> Workspace:
    path = toycar.campaign("toy")
    path.write_text(path.read_text().replace("sample: 24\n", ""))
    return toycar


def pair_key(experiment: Experiment) -> tuple[str, str, str]:
    return experiment.scenario, experiment.fault.id, experiment.trigger.name.removeprefix("random/")


def test_each_guided_experiment_has_a_random_partner(whole: Workspace) -> None:
    experiments = build_plan(whole, "toy").experiments
    guided = Counter(pair_key(e) for e in experiments if e.method is Method.GUIDED)
    random = Counter(pair_key(e) for e in experiments if e.method is Method.RANDOM)
    assert guided == random
    assert set(guided.values()) == {1}
    assert len(guided) == 2 * 2 * (4 + 2 + 4 + 1)  # scenarios, rows, faults


def test_the_reading_determines_when_triggers_are_armed(whole: Workspace) -> None:
    for reading, armed in (("as_described", 1.0), ("as_coded", 0.0)):
        times = set()
        for experiment in build_plan(whole, "toy", Choices(reading=reading)).experiments:
            if experiment.method is Method.GUIDED:
                assert experiment.trigger.armed_after_s == armed
                assert experiment.trigger.hold is Hold.WHILE
            else:
                assert experiment.trigger.hold is Hold.TO_END
                times.add(float(experiment.trigger.condition.removeprefix("t >= ")))
        assert armed <= min(times) <= max(times) <= 5.5
        assert all(time == pytest.approx(round(time / 0.05) * 0.05) for time in times)
        assert len(times) > 20


def test_random_times_differ_between_rows_and_scenarios(whole: Workspace) -> None:
    experiments = [e for e in build_plan(whole, "toy").experiments if e.method is Method.RANDOM]
    silent = [e for e in experiments if e.fault.fault_type == "silence"]
    assert len({e.trigger.condition for e in silent}) == len(silent) == 4


def test_a_seed_gives_the_same_plan_in_any_folder(toycar: Workspace, copy_toycar, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    plan = build_plan(toycar, "toy")
    elsewhere = build_plan(copy_toycar(tmp_path / "elsewhere"), "toy")
    assert (plan.experiments, plan.chunks, plan.digest) == (
        elsewhere.experiments,
        elsewhere.chunks,
        elsewhere.digest,
    )
    other = build_plan(toycar, "toy", Choices(seed=8))
    assert other.digest != plan.digest
    assert all(e.seed == 8 for e in other.experiments)


def test_a_changed_scenario_changes_the_ids(toycar: Workspace) -> None:
    before = build_plan(toycar, "toy")
    with toycar.scenario("A").open("a") as file:
        file.write("\n")
    after = build_plan(toycar, "toy")
    for one, other in zip(before.experiments, after.experiments, strict=True):
        assert (one.id == other.id) == (one.scenario != "A")


def test_experiments_with_the_same_golden_run_are_adjacent(whole: Workspace) -> None:
    plan = build_plan(whole, "toy")
    keys = [(e.scenario, e.fault.changes) for e in plan.experiments]
    assert len(dict.fromkeys(keys)) == 1 + sum(a != b for a, b in pairwise(keys))
    first = 0
    for length in plan.chunks:
        assert length <= plan.campaign.chunk_size
        assert len(set(keys[first : first + length])) == 1
        first += length
    assert first == len(keys)


def test_a_setting_applies_to_all_runs_and_changes_the_ids(whole: Workspace) -> None:
    before = build_plan(whole, "toy")
    path = whole.campaign("toy")
    path.write_text(path.read_text().replace("faults:", "setting: [alone]\nfaults:", 1))
    after = build_plan(whole, "toy")
    assert {e.changes for e in (*after.experiments, after.canary)} == {("alone",)}
    assert {one.changes for one in after.goldens()} == {("alone",)}
    assert Counter(e.fault.id for e in before.experiments) == Counter(e.fault.id for e in after.experiments)
    assert not {e.id for e in before.experiments} & {e.id for e in after.experiments}
    path.write_text(path.read_text().replace("[alone]", "[rainy]"))
    with pytest.raises(MutatorError, match=r"toy\.yaml:\d+: change 'rainy'; expected one of alone"):
        build_plan(whole, "toy")


def test_a_plan_can_be_filtered_and_limited(whole: Workspace) -> None:
    plan = build_plan(
        whole, "toy", Choices(only='scenario == "A"', exclude='method == "random" or value > 60', limit=5)
    )
    assert len(plan.experiments) == 5
    assert all(e.scenario == "A" and e.method is Method.GUIDED for e in plan.experiments)
    assert len({e.fault.fault_type for e in plan.experiments}) == 3
    with pytest.raises(MutatorError, match="no experiment is left"):
        build_plan(whole, "toy", Choices(only="value > 1000"))


def test_a_limit_keeps_guided_and_random_pairs(whole: Workspace) -> None:
    """Paired statistics require complete pairs."""
    plan = build_plan(whole, "toy", Choices(limit=10))
    keys = Counter(
        (e.fault.id, e.scenario, e.trigger.name.removeprefix("random/"), e.seed) for e in plan.experiments
    )
    assert len(plan.experiments) == 10 and set(keys.values()) == {2}


@pytest.mark.parametrize(
    ("choices", "told"),
    [
        ({"only": "t_h1 > 2"}, "unknown column `t_h1`"),
        ({"exclude": "value >"}, "not an expression"),
        ({"limit": 0}, "limit: 0; expected a positive number"),
        ({"seed": -1}, "seed: -1; expected a whole number"),
        ({"reading": "as_dreamt"}, "as_dreamt"),
    ],
)
def test_invalid_options_are_reported(toycar: Workspace, choices: dict, told: str) -> None:
    with pytest.raises(MutatorError, match=told):
        build_plan(toycar, "toy", Choices(**choices))


@pytest.mark.parametrize(
    ("old", "new", "line", "told"),
    [
        ("spec: sensor/*", "spec: sensr/*", 7, "no fault in the library matches 'sensr/*'"),
        ("spec: sensor/*", "spec: sensor/lane", 7, "write 'sensor/lane/*' for all its variants"),
        ("[A, B]", "[A, Z]", 5, "no scenario 'Z'"),
        ("table: near_far", "table: nowhere", 10, "no context table 'nowhere'"),
        ("table: near_far", "table: near_far\n  rows: [near, afar]", 11, "afar"),
        ("hazard: H3", "hazard: H7", 15, "hazard 'H7'"),
        ("sensor/lane/shifted", "sensor/lane", 15, "sensor/lane"),
        ("scenario: A", "scenario: Z", 15, "no scenario 'Z'"),
    ],
)
def test_an_unknown_name_is_reported_with_its_line(
    toycar: Workspace, old: str, new: str, line: int, told: str
) -> None:
    path = toycar.campaign("toy")
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(MutatorError) as error:
        build_plan(toycar, "toy")
    assert told in str(error.value)
    assert (error.value.where, error.value.line) == (str(path), line)


def test_scenarios_must_be_inside_the_library(toycar: Workspace) -> None:
    path, file = toycar.campaign("toy"), toycar.scenario("A")
    text = path.read_text()
    path.write_text(text.replace("[A, B]", f"[A, {file}]"))
    with pytest.raises(MutatorError, match=r"no scenario '.*A\.yaml' in the library; expected one of A, B"):
        build_plan(toycar, "toy")
    (file.parent / "more").mkdir()
    (file.parent / "more" / "C.yaml").write_text(file.read_text())
    path.write_text(text.replace("[A, B]", "[more/C]"))
    assert {e.scenario for e in build_plan(toycar, "toy").experiments} == {"more/C"}


def test_hold_s_sets_the_duration_of_every_fault(toycar: Workspace) -> None:
    path = toycar.campaign("toy")
    path.write_text(path.read_text().replace("  random_until_s", "  hold_s: 1.5\n  random_until_s"))
    triggers = {e.trigger for e in build_plan(toycar, "toy").experiments}
    assert {(trigger.hold, trigger.hold_s) for trigger in triggers} == {(Hold.FOR, 1.5)}


def test_a_campaign_can_limit_the_values_of_each_variant(whole: Workspace) -> None:
    path = whole.campaign("toy")
    path.write_text(path.read_text().replace("  - spec: sensor/*", "  - {spec: sensor/*, values: 2}"))
    faults = {e.fault.id: e.fault.spec for e in build_plan(whole, "toy").experiments}
    assert Counter(faults.values()) == {
        "sensor/distance/longer": 2,
        "sensor/distance/nearer": 2,
        "sensor/lane/shifted": 2,
        "sensor/silence/no_data": 1,
    }


def test_the_expected_time_depends_on_workers_and_rate(toycar: Workspace) -> None:
    plan = build_plan(toycar, "toy")
    one, two = plan.cost(1), plan.cost(2)
    assert one.cpu_s == two.cpu_s > 0
    assert two.wall_s < one.wall_s
    assert two.disk_bytes > 24 * 1000
    assert not one.is_measured
    measured = replace(plan, run_cpu_s=100.0).cost(1)
    assert measured.is_measured
    assert measured.cpu_s > 100 * one.cpu_s / 10


BEYOND = ("software", "vision_weather")  # modules of unpublished faults


def test_quickstart_plans_every_published_variant(clone: Workspace) -> None:
    plan = build_plan(clone, "quickstart")
    experiments = plan.experiments
    variants = {f"{spec.name}/{v.name}" for spec in clone.specs() if spec.module not in BEYOND for v in spec}
    assert len(experiments) == 60
    assert {(e.fault.spec, e.method) for e in experiments} == {(v, m) for v in variants for m in Method}
    scenarios = Counter(e.scenario for e in experiments)
    assert set(scenarios) == {"S1", "S2", "S3", "S4", "S5"}
    assert max(scenarios.values()) - min(scenarios.values()) <= 2
    assert {"C1", "C2", "C3", "C4"} <= {e.trigger.name for e in experiments}


def plan_of(clone: Workspace, tmp_path: Path, **choices: str) -> Plan:
    path = tmp_path / "all.yaml"
    path.write_text(clone.campaign("quickstart").read_text().replace("sample: 60\n", ""))
    return build_plan(clone, path, Choices(**choices))


def test_both_readings_expand_to_all_published_experiments(clone: Workspace, tmp_path: Path) -> None:
    described, coded = (plan_of(clone, tmp_path, reading=r) for r in ("as_described", "as_coded"))
    # values, scenarios, contexts, methods
    assert len(described.experiments) == len(coded.experiments) == 282 * 5 * 4 * 2
    assert len({e.id for e in described.experiments}) == len(described.experiments)
    values = [
        Counter((e.scenario, e.trigger.name, e.fault.spec, e.fault.value) for e in plan.experiments)
        for plan in (described, coded)
    ]
    assert values[0] == values[1]
    shutil.rmtree(tmp_path)


@pytest.mark.parametrize(
    ("campaign", "reading", "promised"),
    [
        ("quickstart", "as_described", "c3e2fa1f50b8700d8fc1156e3272f0f38b86eb0efc9f0f1e5d2ffa7d54fd9cb1"),
        ("quickstart", "as_coded", "4d2ee45ca8a123e8aa48810363a5beee96256cc09b701663e9bdcd44f23ce925"),
        ("paper_smoke", "as_described", "57c3e4b4ed636eac636c9bf6a61aa3141f93c4fbccdd803a5fc3ee6b1a7730ff"),
        ("paper_smoke", "as_coded", "edf3f22b413030b7e82168a7a54847625c135f5f51abfd63a0307099bece2946"),
    ],
)
def test_published_plans_keep_their_digests(
    clone: Workspace, campaign: str, reading: str, promised: str
) -> None:
    """Published results cite the digest and the ids."""
    assert build_plan(clone, campaign, Choices(reading=reading)).digest == promised


def test_the_run_schema_does_not_affect_the_plan_digest(
    toycar: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = build_plan(toycar, "small").digest
    monkeypatch.setattr("mutator.store.run_head.RUN_SCHEMA", "run/9")
    monkeypatch.setattr(
        "mutator.campaigns.plan.RUN_SCHEMA", "run/9", raising=False
    )  # the module that imports it
    assert build_plan(toycar, "small").digest == before
