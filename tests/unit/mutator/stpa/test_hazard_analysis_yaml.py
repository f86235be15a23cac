"""The shipped hazard analysis, and mistakes in an analysis."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.faults.fault_specs import FaultSpec
from mutator.stpa.hazard_analysis_checks import injection_places, list_analysis_problems
from mutator.stpa.hazard_analysis_yaml import HazardAnalysis, load_hazard_analysis
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

STRUCTURE = "control_structure.yaml"
UNSAFE = "unsafe_control_actions.yaml"
FACTORS = "causal_factors.yaml"
PEDALS = "contexts/accelerate_decelerate.yaml"
STEER = "contexts/steer.yaml"


@pytest.fixture(scope="module")
def specs(clone: Workspace) -> tuple[FaultSpec, ...]:
    return clone.specs()


@pytest.fixture(scope="module")
def manifest(clone: Workspace) -> TargetManifest:
    return clone.manifest("openpilot")


@pytest.fixture
def folder(clone: Workspace, tmp_path: Path) -> Path:
    return Path(shutil.copytree(clone.library / "stpa", tmp_path / "stpa"))


def spoil(folder: Path, file: str, old: str, new: str) -> int:
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1))
    return text[: text.index(old)].count("\n") + 1


@pytest.fixture(scope="module")
def analysis(clone: Workspace) -> HazardAnalysis:
    return load_hazard_analysis(clone.library / "stpa")


def test_the_shipped_analysis_has_no_problem(
    analysis: HazardAnalysis, specs: tuple[FaultSpec, ...], manifest: TargetManifest
) -> None:
    assert list_analysis_problems(analysis, specs, manifest) == []
    assert [table.coverage.no_proof_reason for table in analysis.context_tables.values()] == [None] * 3
    assert set(analysis.structure.control_actions) == {"accelerate", "decelerate", "steer"}


def test_faults_are_injected_at_the_papers_locations_and_in_software(analysis: HazardAnalysis) -> None:
    """The paper injects no faults into the controllers' software."""
    places = {place for factor in analysis.factors_by_id.values() if factor.faults for place in factor.where}
    sensed = {"own_speed", "own_motion", "steer_angle"}
    assert places == {"radar_points", "pictures", "vision_lead", "path", *sensed, "acc", "lkas"}
    software = {name for name, factor in analysis.factors_by_id.items() if {"acc", "lkas"} & {*factor.where}}
    faults = {fault for name in software for fault in analysis.factors_by_id[name].faults}
    assert faults and all(fault.startswith("software/") for fault in faults)


def test_a_spec_with_two_locations_is_listed_at_both(clone: Workspace) -> None:
    """The as-coded reading can inject at another location."""
    assert injection_places(clone.spec("radar/jamming"), clone.manifest("openpilot")) == {
        "selfdrive/sim/radar.py::RadarSensor.measure",
        "selfdrive/sim/simulator.py::Simulator.step",
    }


def test_a_function_inside_another_counts_as_the_outer_one(clone: Workspace) -> None:
    """Causal factors name functions that the hazard analysis can find."""
    spec = clone.spec("radar/chaff")
    (variant, *_) = spec
    readings = {
        name: tuple(
            replace(injection, location=replace(injection.location, function="Outer.f.<locals>.g"))
            for injection in injections
            if injection.location
        )
        for name, injections in variant.injections_by_reading.items()
    }
    nested = replace(spec, variants=(replace(variant, injections_by_reading=readings),))
    assert injection_places(nested, clone.manifest("openpilot")) == {"selfdrive/sim/radar.py::Outer.f"}


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        (
            PEDALS,
            "C3:\n    when: hwt > safe_hwt_s",
            "C3:\n    when: hwt > 3",
            "no context holds at 2.0 < hwt",
        ),
        (STEER, "when: v_ego < min_steer_mps", "when: v_ego <= min_steer_mps", "'W2' overlaps 'W1' at v_ego"),
        (STEER, "when: v_ego < min_steer_mps", "when: offset <", "invalid syntax"),
        (
            STEER,
            "steer: {provided: null",
            "steering: {provided: null",
            "context 'W2'; expected the actions of 'W1'",
        ),
        (STRUCTURE, "drawn: [2, 1, 2]", "drawn: [2, 2, 2]", "'lkas' drawn at [2, 3, 2], where 'acc' is"),
        (STRUCTURE, "drawn: [2, 1, 2]", "drawn: [2, 1, 0]", "a width of at least 1"),
        (STRUCTURE, "drawn: [2, 1, 2]", "drawn: [2, 1, 1000000000000]", "width of at most 100"),
        (STRUCTURE, "to: powertrain", "to: powertrian", "did you mean 'powertrain'"),
        (STRUCTURE, "accelerate: {link: gas", "accelerate: {link: gass", "link 'gass'"),
        (
            STRUCTURE,
            "accelerate: {link: gas",
            "accelerate: {link: echo",
            "a link that comes from a controller",
        ),
        (UNSAFE, "tables: [accelerate_decelerate", "tables: [pedals", "context table 'pedals'"),
        (UNSAFE, "action: accelerate", "action: speed_up", "control action 'speed_up'"),
        (UNSAFE, "hazards: [H2]", "hazards: [H5]", "hazard 'H5'"),
        (UNSAFE, "hazards: [H2]", "hazards: []", "for 'hazards'"),
        (
            UNSAFE,
            "accelerate_decelerate/C3]",
            "accelerate_decelerate/C5]",
            "context 'accelerate_decelerate/C5'",
        ),
        (UNSAFE, "category: not_provided", "category: forgotten", "'forgotten' for 'category'"),
        (FACTORS, "where: [radar_points]", "where: [radar_lines]", "link or component 'radar_lines'"),
        (FACTORS, "[UCA2,", "[UCA99,", "unsafe control action 'UCA99'"),
        (FACTORS, "faults: [radar/chaff]", "faults: []", "neither faults nor no_fault in 'CF1'"),
    ],
)
def test_an_inconsistent_analysis_is_refused(folder: Path, file: str, old: str, new: str, said: str) -> None:
    spoil(folder, file, old, new)
    with pytest.raises(MutatorError) as caught:
        load_hazard_analysis(folder)
    assert said in str(caught.value)
    assert caught.value.where == str(folder / file)
    assert caught.value.line is not None and caught.value.line > 1


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        (STRUCTURE, "observed: rs", "observed: null", "context 'C1' uses 'rs'"),
        (STRUCTURE, "channel: gas", "channel: throttle", "channel 'throttle'"),
        (
            STRUCTURE,
            "selfdrive/controls/plannerd.py",
            "selfdrive/planner.py",
            "no file 'selfdrive/planner.py'",
        ),
        (STRUCTURE, "kind: sensor", "faults: [radar/chuff]\n    kind: sensor", "no fault 'radar/chuff'"),
        (STRUCTURE, "kind: sensor", "faults: ['radar/*', 'rader/*']\n    kind: sensor", "no fault 'rader/*'"),
        (UNSAFE, "contexts: [accelerate_decelerate/C3]", "contexts: [accelerate_decelerate/C1]", "in accel"),
        (PEDALS, "provided: H1", "provided: null", "expected what accelerate_decelerate.yaml says there"),
        (
            PEDALS,
            "accelerate: {provided: null",
            "accelerate: {provided: H1",
            "matches no unsafe control action",
        ),
        (FACTORS, "RadarSensor.measure", "RadarSensor.measures", "did you mean 'RadarSensor.measure'"),
        (FACTORS, "faults: [radar/chaff]", "faults: [radar/chuff]", "did you mean 'radar/chaff'"),
        (
            FACTORS,
            "faults: [radar/chaff]",
            "faults: [car_sensors/steer]",
            "car_sensors/steer/angle aims at H3",
        ),
        (FACTORS, "faults: [radar/chaff]", "no_fault: none", "'radar/chaff' belongs to no causal factor"),
        (
            FACTORS,
            "[vision_output/path_model]",
            "[vision_input/blur]",
            "injected: selfdrive/sim/picture_camera",
        ),
        ("hazards.yaml", "\nhazards:", "\n  A4: A fire.\nhazards:", "accident 'A4' follows from no hazard"),
        (
            STRUCTURE,
            "observed: rs",
            "observed: ttc",
            "variable 'ttc'; expected one of the values observed in the target: t",
        ),
    ],
)
def test_gaps_and_contradictions_are_reported_with_their_line(
    folder: Path,
    specs: tuple[FaultSpec, ...],
    manifest: TargetManifest,
    file: str,
    old: str,
    new: str,
    said: str,
) -> None:
    spoil(folder, file, old, new)
    problems = list_analysis_problems(load_hazard_analysis(folder), specs, manifest)
    assert [p for p in problems if said in str(p) and p.where and p.line], [str(p) for p in problems]


def test_every_hazard_and_category_must_be_judged(
    folder: Path, specs: tuple[FaultSpec, ...], manifest: TargetManifest
) -> None:
    text = (folder / UNSAFE).read_text()
    (folder / UNSAFE).write_text(text[: text.index("  UCA14:")] + text[text.index("  UCA15:") :])
    (folder / FACTORS).write_text((folder / FACTORS).read_text().replace(", UCA14]", "]"))
    (folder / "hazards.yaml").write_text(
        (folder / "hazards.yaml").read_text() + "  H5: {about: Too loud., leads_to: [A1]}\n"
    )
    problems = [str(p) for p in list_analysis_problems(load_hazard_analysis(folder), specs, manifest)]
    assert len(problems) == 2, problems
    assert "hazard 'H5' follows from no unsafe control action" in problems[0]
    assert "no unsafe control action for 'steer' in category wrong_duration" in problems[1]


def test_an_unsafe_action_without_a_cause_is_reported(
    folder: Path, specs: tuple[FaultSpec, ...], manifest: TargetManifest
) -> None:
    text = (folder / FACTORS).read_text()
    (folder / FACTORS).write_text(text.replace(", UCA13", ""))
    (problem,) = list_analysis_problems(load_hazard_analysis(folder), specs, manifest)
    assert "no causal factor leads to UCA13" in str(problem)
