"""The check of a library, and the shipped library."""

import ast
from collections import Counter
from pathlib import Path

import pytest

from mutator.checks.library_check import library_problems
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault, Hold
from mutator.mutants.mutant_building import build
from mutator.mutants.probe_contract import probe_path
from mutator.mutants.splicing import unsplice
from mutator.targets.source_tree import matches_any_glob
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

# Values per trigger of the published fault types.
COUNTS = {
    **{("vision_input", name): 10 for name in ("rain", "fog", "snow", "occlusion", "contrast", "brightness")},
    ("vision_input", "blur"): 9,
    ("radar", "chaff"): 24,
    ("radar", "invisible_vehicle"): 6,
    ("radar", "ghost_vehicle"): 31,
    ("radar", "jamming"): 1,
    ("car_sensors", "speed"): 12,
    ("car_sensors", "steer"): 10,
    ("vision_output", "camera_unavailable"): 1,
    ("vision_output", "path_model"): 30,
    ("vision_output", "relative_distance"): 49,
    ("radar_vision", "relative_distance"): 49,
}


BEYOND = ("software", "vision_weather")  # modules of unpublished faults


@pytest.fixture(scope="module")
def everything() -> dict[str, tuple[Fault, ...]]:
    clone = Workspace.find(root=Path(__file__).parents[4])
    manifest, models = clone.manifest("openpilot"), clone.fault_models()
    return {
        reading: tuple(
            fault
            for spec in clone.specs()
            for fault in expand_spec(spec, 1, reading, models=models, manifest=manifest)
        )
        for reading in clone.readings().names
    }


@pytest.fixture(scope="module")
def faults(everything: dict[str, tuple[Fault, ...]]) -> dict[str, tuple[Fault, ...]]:
    return {name: tuple(f for f in found if f.module not in BEYOND) for name, found in everything.items()}


def test_the_shipped_library_has_no_problem(clone: Workspace) -> None:
    assert library_problems(clone, "openpilot") == []


def test_published_fault_types_have_the_published_number_of_values(
    faults: dict[str, tuple[Fault, ...]],
) -> None:
    assert list(faults) == ["as_described", "as_coded"]
    for found in faults.values():
        assert Counter((f.module, f.fault_type) for f in found) == COUNTS
        assert len({f.id for f in found}) == 282


def test_values_have_the_expected_ranges_and_signs(faults: dict[str, tuple[Fault, ...]]) -> None:
    by_spec: dict[str, list[Fault]] = {}
    for fault in faults["as_described"]:
        by_spec.setdefault(fault.spec, []).append(fault)

    def params(spec: str, injection: int = 0) -> list[dict[str, object]]:
        return [dict(f.injections[injection].params) for f in by_spec[spec]]

    chaff = by_spec["radar/chaff/distance"]
    assert all(15 + 10 * i <= f.value <= 24 + 10 * i for i, f in enumerate(chaff))
    assert all(p["by"] > 0 for p in params("radar/invisible_vehicle/speed"))
    assert params("radar/invisible_vehicle/speed")[-1]["by"] == pytest.approx(26.8224)
    for spec in ("radar/ghost_vehicle/distance", "vision_output/relative_distance/shorter"):
        assert len(by_spec[spec]) == 25
        assert all(p["by"] < 0 and p["low"] == 0.0 for p in params(spec))
    assert all(p["by"] < 0 for p in params("radar/ghost_vehicle/speed"))
    assert all(p["low"] == 0.0 and p["by"] < 0 for p in params("car_sensors/speed/slower"))
    assert all(p["high"] == pytest.approx(193.12128) for p in params("car_sensors/speed/faster"))
    for i, fault in enumerate(by_spec["car_sensors/steer/angle"]):
        assert -45 + 9 * i <= fault.value <= -36 + 9 * i
    for side in ("left", "right", "both"):
        for i, fault in enumerate(by_spec[f"vision_output/path_model/{side}"]):
            assert -2.5 + 0.5 * i <= fault.value <= -1.5 + 0.5 * i
    assert params("radar_vision/relative_distance/longer") == [
        p | {"target": "d_rel"} for p in params("radar_vision/relative_distance/longer", 1)
    ]


def test_faults_have_the_expected_aims_holds_and_changes(faults: dict[str, tuple[Fault, ...]]) -> None:
    """Faults without a lead vehicle aim at H2; steering, lane and image faults at H3; all others at H1."""
    for fault in faults["as_described"]:
        seen = fault.module == "vision_input"
        lateral = seen or fault.fault_type in ("steer", "path_model", "camera_unavailable")
        assert ("pictures" in fault.changes) == seen
        assert fault.aim == ("H3" if lateral else "H2" if fault.changes == ("no_lead",) else "H1")
        assert (fault.hold is Hold.TO_END) == (fault.fault_type in ("jamming", "camera_unavailable"))
    for fault in faults["as_coded"]:
        assert (fault.hold is Hold.TO_END) == (fault.module == "vision_input")
    alone = Counter(f.fault_type for f in faults["as_described"] if "no_lead" in f.changes)
    assert alone == {"ghost_vehicle": 31, "speed": 6, "relative_distance": 50}


def test_the_readings_share_values_and_differ_in_injections(faults: dict[str, tuple[Fault, ...]]) -> None:
    """As coded, units are wrong, lanes drift, and jamming stops all CAN messages."""
    described, coded = faults["as_described"], faults["as_coded"]
    assert [(f.spec, f.value) for f in described] == [(f.spec, f.value) for f in coded]
    differing = {f.fault_type for f, g in zip(described, coded, strict=True) if f.injections != g.injections}
    pictures = {f.fault_type for f in described if f.module == "vision_input"}
    assert differing == {"speed", "steer", "path_model", "jamming"} | pictures
    for fault, slipped in zip(described, coded, strict=True):
        value = dict(fault.injections[0].params).get("by")
        other = dict(slipped.injections[0].params)
        if fault.fault_type == "speed":
            assert other["by"] == pytest.approx(value / 3.6)
            assert other.get("high", 85.0) == 85.0
        if fault.fault_type == "steer":
            assert abs(other["by"]) < 0.8 and other["by"] == pytest.approx(value / 57.29577951)
        if fault.fault_type == "path_model":
            assert {i.model for i in slipped.injections} == {"drift"}
            assert (other["per_step"], other["stays"]) == (value, True)
        if fault.module == "vision_input":
            assert (other["amount"], other["scene"]) == (dict(fault.injections[0].params)["amount"], "truth")
            assert slipped.injections[0].location.anchor.name == "frame"
        if fault.fault_type == "jamming":
            assert slipped.injections[0].location.path == "selfdrive/sim/simulator.py"


def test_radar_and_camera_can_be_compared(faults: dict[str, tuple[Fault, ...]]) -> None:
    values: dict[str, list[object]] = {}
    for fault in faults["as_described"]:
        values.setdefault(fault.spec, []).append(fault.value)
    longer = values["radar/chaff/distance"]
    shorter = values["radar/ghost_vehicle/distance"]
    for module in ("vision_output", "radar_vision"):
        assert values[f"{module}/relative_distance/longer"] == longer
        assert values[f"{module}/relative_distance/shorter"] == shorter


def test_levels_of_image_effects_are_the_published_ones(faults: dict[str, tuple[Fault, ...]]) -> None:
    levels: dict[str, list[object]] = {}
    for fault in faults["as_described"]:
        if fault.module == "vision_input":
            levels.setdefault(fault.spec.removeprefix("vision_input/"), []).append(fault.value)
            assert dict(fault.injections[0].params)["amount"] == fault.value
    ten = list(range(1, 11))
    assert levels == {
        **{f"{name}/thickness": ten for name in ("rain", "fog", "snow")},
        "occlusion/blobs": ten,
        "contrast/gain": [1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.4, 2.6, 2.8, 3.0],
        "brightness/bias": list(range(10, 101, 10)),
        "blur/averaging": [3, 4, 5, 6],
        "blur/gaussian": [3, 5, 7],
        "blur/median": [3, 5],
    }


def test_each_effect_has_its_own_seed(everything: dict[str, tuple[Fault, ...]]) -> None:
    seeds = {
        reading: [dict(i.params)["seed"] for f in found for i in f.injections if i.model == "image_effect"]
        for reading, found in everything.items()
    }
    assert seeds["as_described"] == seeds["as_coded"]
    assert len(set(seeds["as_described"])) == len(seeds["as_described"])


def test_two_effects_act_in_the_order_of_the_spec(
    clone: Workspace, everything: dict[str, tuple[Fault, ...]]
) -> None:
    manifest, models = clone.manifest("openpilot"), clone.fault_models()
    fault = next(f for f in everything["as_described"] if f.fault_type == "rain_and_fog")
    made = build(manifest, models, fault, always_trigger())
    text = made.files["selfdrive/sim/picture_camera.py"].decode()
    assert 0 < text.index(f"import Fog  # fi:{made.injection_ids[0]}") < text.index("lambda: Rain(5.0, ")


def test_code_that_draws_or_reads_frames_cannot_have_faults(clone: Workspace) -> None:
    """All runs share the frames."""
    manifest = clone.manifest("openpilot")
    todo, closed = ["selfdrive/sim/road_renderer.py", "selfdrive/sim/image_folder.py"], set()
    while todo:
        path = todo.pop()
        closed.add(path)
        for node in ast.walk(ast.parse(manifest.tree.files[path])):
            if isinstance(node, ast.ImportFrom) and node.module:
                base = node.module.replace(".", "/")
                needed = {f"{base}.py", *(f"{base}/{alias.name}.py" for alias in node.names)}
                todo += (needed & manifest.tree.files.keys()) - closed
    assert {"selfdrive/common/camera_model.py", "selfdrive/sim/road_look.py"} <= closed
    harmless = {
        "selfdrive/common/errors.py",
        "selfdrive/common/conversions.py",
    }  # modules that compute nothing
    open_to_faults = {path for path in closed if not matches_any_glob(path, manifest.forbidden_globs)}
    assert open_to_faults <= harmless
    assert matches_any_glob("selfdrive/sim/image_library.py", manifest.forbidden_globs)


@pytest.mark.slow
def test_every_mutant_of_the_library_compiles_and_can_be_undone(
    clone: Workspace, everything: dict[str, tuple[Fault, ...]]
) -> None:
    manifest, models = clone.manifest("openpilot"), clone.fault_models()
    triggers = clone.context_table("accelerate_decelerate").triggers(armed_after_s=1.5)
    ids = set()
    found = (*everything["as_described"], *everything["as_coded"])
    for fault in found:
        for trigger in triggers:
            made = build(manifest, models, fault, trigger)
            ids.add(made.id)
            for path, data in made.files.items():
                if path != probe_path(manifest.probe_package):
                    assert unsplice(data) == manifest.tree.files[path]
    assert len(ids) == len(found) * 4


def edited(toy: Workspace, file: str, old: str, new: str) -> list[str]:
    """Edit a file. Return all problems of the toy's library, without the folder's name."""
    path = toy.library.parent / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    return [str(p).replace(f"{toy.library.parent}/", "") for p in library_problems(toy, "toy")]


def test_each_variant_without_its_anchor_is_a_problem(toy: Workspace) -> None:
    problems = edited(toy, "target/toycar/sensor.py", "gap = truth.gap", "distance = truth.gap")
    assert len(problems) == 3, "expected two variants, one of them in two readings"
    assert problems[0].startswith(
        "fault_library/faults/sensor/distance.yaml:14: sensor/distance/longer (as_described): "
        "no assignment to 'gap' in Sensor.measure (toycar/sensor.py:12); expected one of 'distance' (line 14)"
    )


def test_an_ambiguous_anchor_is_reported_with_both_candidates(toy: Workspace) -> None:
    problems = edited(toy, "target/toycar/sensor.py", "gap = truth.gap", "gap = 0\n        gap = truth.gap")
    assert "assignment to 'gap' matches 2 statements in Sensor.measure: lines 14, 15" in problems[0]


def test_problems_do_not_hide_each_other(toy: Workspace) -> None:
    (toy.library / "stpa" / "contexts" / "pedals.yaml").write_text("schema: context_table/9\n")
    problems = edited(toy, "fault_library/faults/sensor/distance.yaml", "model: scale", "model: skale")
    assert len(problems) == 2
    assert "context_table/9" in problems[0] and "unknown fault model 'skale'" in problems[1]


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        (
            "fault_library/targets/toy.yaml",
            "hazards: [H1]",
            "hazards: [H1, H7]",
            "hazard 'H7'; expected one of H1",
        ),
        (
            "fault_library/stpa/contexts/pedals.yaml",
            "provided: H1",
            "provided: H7",
            "hazard 'H7' of accelerate in near; expected one of H1, or null",
        ),
        (
            "fault_library/targets/toy.yaml",
            "after_assign: now",
            "after_assign: then",
            "world.py:17: no assignment to 'then' in World.step; expected one of 'now' (line 18)",
        ),
        ("target/toycar/world.py", "def step", "def step(", "target/toycar/world.py:17: not valid Python"),
    ],
)
def test_other_problems_are_reported(toy: Workspace, file: str, old: str, new: str, said: str) -> None:
    problems = edited(toy, file, old, new)
    assert any(said in problem for problem in problems)


def test_a_problem_of_one_injection_is_reported_at_its_line(toycar: Workspace) -> None:
    path = toycar.library / "faults" / "sensor" / "lane.yaml"
    at = "        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: offset}\n"
    one = at + "          model: offset\n          unit: m\n          params: {by_m: offset}\n"
    text = path.read_text()
    assert text.count(one) == 1
    path.write_text(text.replace(one, one + one.replace("after_assign: offset", "after_assign: nothing")))
    line = text[: text.index(one)].count("\n") + 5
    (problem,) = [p for p in library_problems(toycar, "toycar") if "sensor/lane/shifted" in str(p)]
    assert (problem.where, problem.line) == (str(path), line)
