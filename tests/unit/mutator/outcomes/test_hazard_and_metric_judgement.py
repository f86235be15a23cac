"""Hazards, ends of drives and metrics, compared with values computed by hand."""

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator.errors import BadOutput, MutatorError
from mutator.outcomes.hazard_and_metric_judgement import (
    RunJudgement,
    is_engaged_at_end,
    judge_run,
    load_judged_run,
)
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.targets.manifest import TargetManifest

from .cart import GAP, SPEED, T, write_manifest

Write = Callable[..., TargetManifest]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    return partial(write_manifest, tmp_path)


def judged(manifest: TargetManifest, golden_run: Trace | None = None, **channels: Any) -> RunJudgement:
    trace = {"time": T, "gap": GAP, "speed": SPEED, "force": SPEED} | channels
    return judge_run(manifest, trace, {"hazards": {}}, golden_run)


@pytest.mark.parametrize(
    ("rule", "first"),
    [
        ("when: gap <= 1", 1.0),
        ("when: gap < 1", 3.0),
        ("when: gap < -5", None),
        ("{when: gap <= 2, for_s: 2}", 3.0),  # held from 1 s to 4 s
        ("{when: gap <= 1, for_s: 1}", 4.0),  # held from 3 s; the earlier period is too short
        ("{when: gap <= 1, for_s: 2}", None),
        ("when: left < 1", 1.0),  # `left`, a derived value: 1 m at 2 m/s
        ("when: rate(gap) > 3", 5.0),
        ("when: ever(gap <= 0) and speed <= 0", 5.0),
        ("when: t >= 2 and not gap > 1", 3.0),
        ("when: hypot(gap, speed) >= abs(-4)", 5.0),
        ("when: min(gap, speed) < 0", 2.0),
    ],
)
def test_a_hazard_occurs_when_its_condition_has_held_long_enough(
    write: Write, rule: str, first: float | None
) -> None:
    rule = rule if rule.startswith("{") else f"{{{rule.replace(': ', ': ', 1)}}}"
    key, _, value = rule.strip("{}").partition(": ")
    condition, _, more = value.partition(", for_s")
    more = f", for_s{more}" if more else ""
    found = judged(write(f'hazards: {{HIT: {{{key}: "{condition}"{more}}}}}\n'))
    assert found.hazards == (() if first is None else (("HIT", first),))
    assert found.t_end is None


@pytest.mark.parametrize(
    ("metric", "value"),
    [
        ("min: gap", 0.0),  # the value at contact, not -1 after it
        ("max: gap", 3.0),  # not 4, which occurs after the end
        ("mean: speed", 1.0),
        ("last: speed", 2.0),
        ("integral: speed", 2.0),  # 1 + 2 - 1: each value lasts until the next step, and the last is left out
        ('duration: "speed > 0"', 2.0),
        ("at_end: speed", 2.0),
        ("at_hazard: rate(speed), hazard: HIT", 3.0),
        ("at_hazard: speed, hazard: LATE", None),  # the drive had ended
        ("at_hazard: speed, hazard: NEVER", None),
        ("min: left", 0.0),
        ('{min: gap, where: "speed < 0"}', 2.0),
        ('{min: gap, where: "speed > 9"}', None),
        ("max: rate(speed)", 3.0),
        ("{min: gap, ends_before_s: 0}", 1.0),  # without the step of the contact
        ("{min: speed, ends_before_s: 2}", 1.0),  # the steps before 1 s
        ("{integral: speed, ends_before_s: 0}", 2.0),  # the value before the contact lasts until it
        ("{integral: speed, ends_before_s: 1.5}", 2.0),
        ("{min: gap, ends_before_s: 3}", None),  # no step is left
        ("max: gap / (speed - speed)", None),  # NaN and infinities are left out
    ],
)
def test_metrics_end_with_the_step_of_the_first_terminal_hazard(
    write: Write, metric: str, value: float | None
) -> None:
    what = metric.strip("{}")
    found = judged(
        write(
            'hazards: {HIT: {when: "gap <= 0", terminal: true}, '
            'LATE: {when: "gap < 0"}, NEVER: {when: "gap > 9"}}\n'
            f'metrics: {{it: {{{what}, unit: m, worse: lower, about: "x"}}}}\n'
        )
    )
    assert found.t_end == 3.0
    assert dict(found.metrics).get("it") == value


def test_without_a_terminal_hazard_metrics_cover_the_whole_run(write: Write) -> None:
    found = judged(
        write(
            "hazards: {}\nmetrics:\n"
            "  least: {min: gap, unit: m, worse: lower, about: x}\n"
            "  final: {at_end: gap, unit: m, worse: lower, about: x}\n"
        )
    )
    assert (found.t_end, dict(found.metrics)) == (None, {"least": -1.0})


def test_a_hazard_can_occur_before_the_end_of_the_drive(write: Write) -> None:
    found = judged(write('hazards: {NEAR: {when: "gap <= 1", terminal: "gap <= 0", unit: m}}\n'))
    assert (found.hazards, found.t_end) == ((("NEAR", 1.0),), 3.0)
    assert dict(found.metrics) == {"margin_near": -1.0}  # gap - 1, at contact


GOLDEN = np.array([3.0, 2.0, 1.0, 1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("metric", "value"),
    [
        ("max: abs(gap - golden.gap)", 1.0),  # up to contact; later the two are 2 m and 3 m apart
        ("min: gap - golden.gap", -1.0),
        ("last: golden.gap - gap", 1.0),
        ("mean: golden.gap", 7 / 4),
        ("integral: golden.gap", 6.0),
        ('duration: "gap < golden.gap"', 1.0),
        ("at_end: golden.gap", 1.0),
        ('{max: speed, where: "golden.gap < 2"}', 2.0),
        ("max: golden.left", 0.5),  # a derived value: 3 m, 2 m, 1 m, 1 m at 6 m/s
        ("max: rate(golden.gap)", 0.0),
    ],
)
def test_a_metric_can_compare_a_run_with_its_golden_run(write: Write, metric: str, value: float) -> None:
    manifest = write(
        'hazards: {HIT: {when: "gap <= 0", terminal: true}}\n'
        f"metrics: {{it: {{{metric.strip('{}')}, unit: m, worse: lower, about: x}}}}\n",
        observation="  golden: {unit: m}\nobservation:",
    )
    golden = {"time": T, "gap": GOLDEN, "speed": np.full(6, 6.0), "golden": T}
    assert dict(judged(manifest, golden, golden=T).metrics)["it"] == value
    assert "it" not in dict(judged(manifest, golden=T).metrics)  # the golden run itself


@pytest.mark.parametrize(
    ("steps", "golden_steps", "worst", "apart_s", "final"),
    [
        (6, 6, 5.0, 5.0, 5.0),
        (3, 6, 2.0, 2.0, None),  # the faulty run ends at 2 s, without contact
        (6, 3, 2.0, 3.0, None),  # the golden run ends at 2 s, before the contact at 5 s
        (6, 0, None, 0.0, None),
    ],
)
def test_a_metric_of_both_runs_covers_the_steps_that_both_have(
    write: Write, steps: int, golden_steps: int, worst: float | None, apart_s: float, final: float | None
) -> None:
    manifest = write(
        'hazards: {HIT: {when: "gap >= 5", terminal: true}}\nmetrics:\n'
        "  worst: {max: abs(gap - golden.gap), unit: m, worse: higher, about: x}\n"
        '  apart_s: {duration: "not gap == golden.gap - 9", unit: s, worse: higher, about: x}\n'
        "  final: {at_end: gap - golden.gap, unit: m, worse: higher, about: x}\n"
    )
    golden = {"time": T[:golden_steps], "gap": np.zeros(golden_steps), "speed": T[:golden_steps]}
    run = dict.fromkeys(("time", "gap", "speed", "force"), T[:steps])
    found = dict(judged(manifest, golden, **run).metrics)
    expected = {"margin_hit": 6.0 - steps, "worst": worst, "apart_s": apart_s, "final": final}
    assert found == {name: value for name, value in expected.items() if value is not None}


def test_a_run_that_stops_at_its_terminal_hazard_has_the_same_metrics(write: Write) -> None:
    aggregates = ("min", "max", "mean", "last", "integral", "at_end")
    manifest = write(
        'hazards: {HIT: {when: "gap <= 0", terminal: true}}\nmetrics:\n'
        + "".join(
            f"  {name}_: {{{name}: gap - golden.gap, unit: m, worse: lower, about: x}}\n"
            for name in aggregates
        )
    )
    golden = {"time": T, "gap": GOLDEN, "speed": SPEED}
    whole = judged(manifest, golden).metrics
    stopped = judged(manifest, golden, time=T[:4], gap=GAP[:4], speed=SPEED[:4], force=SPEED[:4]).metrics
    assert len(whole) == 1 + len(aggregates)
    assert stopped == whole


def test_a_run_without_a_channel_that_a_metric_reads_of_the_golden_run_is_refused(
    write: Write, tmp_path: Path
) -> None:
    manifest = write("hazards: {}\nmetrics: {it: {max: golden.gap, unit: m, worse: lower, about: x}}\n")
    np.savez(tmp_path / "trace.npz", time=T, force=SPEED)
    with pytest.raises(BadOutput, match="no channel 'gap'"):
        load_judged_run(manifest, tmp_path)


def test_other_steps_are_compared_with_the_newest_golden_value(write: Write) -> None:
    manifest = write("hazards: {}\nmetrics: {it: {last: golden.gap, unit: m, worse: lower, about: x}}\n")
    golden = {"time": T, "gap": GAP, "speed": SPEED}
    run = {name: np.zeros(3) for name in ("gap", "speed", "force")}
    for times, newest in (([0.0, 0.5, 1.9], 1.0), ([0.5, 2.0, 3.0], 0.0), ([0.5, 4.0, 7.0], -1.0)):
        assert dict(judged(manifest, golden, time=np.array(times), **run).metrics) == {"it": newest}


CONTACT = (
    'hazards: {HIT: {when: "gap <= 0", terminal: true}, OUT: {when: "speed < 0", terminal: OUT_ENDS}}\n'
    "metrics: {impact: {at_end: speed, unit: m/s, worse: higher, about: x}}\n"
    "severity: {contact: HIT, contact_speed: impact, mass_kg: 1000, other_mass_kg: 3000, scale: collision}\n"
)


@pytest.mark.parametrize(
    ("speed", "delta_v"),
    [
        (2.0, 1.5),  # 1 t hits 3 t at 2 m/s, and both continue at 0.5 m/s
        (-4.0, 0.0),  # the wall moves away, so they touch and separate
        (np.nan, None),
    ],
)
def test_the_delta_v_of_a_contact_is_a_metric(write: Write, speed: float, delta_v: float | None) -> None:
    manifest = write(CONTACT.replace("OUT_ENDS", "false"))
    found = judged(manifest, speed=np.array([1.0, 2.0, -1.0, speed, 9.0, 9.0]))
    assert found.t_end == 3.0
    assert dict(found.metrics).get("delta_v") == delta_v


def test_only_the_contact_that_ends_the_drive_has_a_delta_v(write: Write) -> None:
    found = judged(write(CONTACT.replace("OUT_ENDS", "true")))
    assert (found.t_end, found.hazards) == (2.0, (("HIT", 3.0), ("OUT", 2.0)))
    assert dict(found.metrics) == {"margin_hit": 1.0, "margin_out": -1.0, "impact": -1.0}
    never = judged(write(CONTACT.replace("OUT_ENDS", "false")), gap=GAP + 2.0)
    assert (never.t_end, "delta_v" in dict(never.metrics)) == (None, False)
    same_step = judged(write(CONTACT.replace("OUT_ENDS", "true")), gap=GAP - 2.0)
    assert (same_step.t_end, dict(same_step.metrics)["delta_v"]) == (1.0, 1.5)


@pytest.mark.parametrize(
    ("rule", "margin"),
    [
        ('{when: "gap <= 1"}', -2.0),  # gap - 1
        ('{when: "abs(speed) > 1.5"}', -0.5),  # 1.5 - abs(speed)
        ('{when: "gap <= 1 and speed > 0"}', None),  # two comparisons, so the margin is ambiguous
        ('{when: "gap <= 1 and speed > 0", margin: gap - 1}', -2.0),
    ],
)
def test_the_smallest_margin_is_a_metric(write: Write, rule: str, margin: float | None) -> None:
    assert dict(judged(write(f"hazards: {{HIT: {rule}}}\n")).metrics).get("margin_hit") == margin


def test_a_hazard_without_a_condition_is_read_from_the_record(write: Write) -> None:
    manifest = write('record: record.json\nhazards: {HIT: {terminal: true}, NEAR: {when: "gap < 0.5"}}\n')
    trace = {"time": T, "gap": GAP, "speed": SPEED}
    found = judge_run(manifest, trace, {"hazards": {"HIT": 2.5, "OTHER": 1.0}})
    assert (found.hazards, found.t_end) == ((("HIT", 2.5), ("NEAR", 3.0)), 2.5)
    listed = judge_run(write("record: record.json\nhazards: [HIT]\n"), trace, {"hazards": {"HIT": None}})
    assert listed.hazards == ()


def test_a_slow_channel_keeps_its_newest_value(write: Write) -> None:
    manifest = write(
        'hazards: {SEEN: {when: "seen < 2"}}\n',
        observation="  seen: {unit: m, role: internal, time: t_seen}\nobservation:",
    )
    trace = {"time": T, "seen": np.array([5.0, 1.0]), "seen@": np.array([0.5, 3.5])}
    assert judge_run(manifest, trace, {}).hazards == (("SEEN", 4.0),)


def test_durations_and_integrals_use_the_times_of_the_trace(write: Write) -> None:
    manifest = write(
        'hazards: {HIT: {when: "gap < 2", for_s: 0.5}}\n'
        "metrics: {way: {integral: speed, unit: m, worse: lower, about: x}}\n"
    )
    trace = {"time": np.array([0, 0.1, 0.2, 1.0]), "gap": np.array([3, 1, 1, 1.0]), "speed": np.ones(4)}
    found = judge_run(manifest, trace, {})
    assert found.hazards == (("HIT", 1.0),)
    assert dict(found.metrics)["way"] == pytest.approx(1.0)


def test_an_infinite_value_in_the_last_step_warns_of_nothing(write: Write) -> None:
    """The last step lasts 0 s, and infinity times 0 is no number."""
    manifest = write(
        "hazards: {NEAR: {when: gap < -9}}\n"
        "metrics: {way: {integral: speed, unit: m, worse: lower, about: x}}\n"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = judged(manifest, speed=np.append(SPEED[:-1], np.inf))
    assert dict(found.metrics)["way"] == 5.0  # 1 + 2 - 1 + 2 + 1


def test_a_temporal_formula_is_judged_after_its_horizon(write: Write) -> None:
    pytest.importorskip("rtamt")
    rule = "(gap < 2) implies eventually[0:2](gap > 3)"
    found = judged(write(f'hazards: {{LATE: {{stl: "{rule}", unit: m}}}}\n'))
    assert found.hazards == (("LATE", 3.0),)  # below 2 m at 1 s, and not above 3 m by 3 s
    assert dict(found.metrics) == {"margin_late": -1.0}  # at 1 s; the trace ends too early for 4 s and 5 s
    with pytest.raises(MutatorError, match=r"cart.yaml:20: unknown name 'speeed' in"):
        write('hazards: {LATE: {stl: "historically(speeed < 3)"}}\n')
    with pytest.raises(MutatorError, match=r"cart.yaml:20: a time that is not a multiple of the step, 1 s"):
        write('hazards: {LATE: {stl: "historically[0:0.5](speed < 3)"}}\n')


def test_temporal_logic_needs_even_steps(write: Write) -> None:
    pytest.importorskip("rtamt")
    manifest = write('hazards: {LATE: {stl: "speed < 3"}}\n')
    with pytest.raises(BadOutput, match="a step of 2 s at 4 s"):
        judged(manifest, time=np.array([0.0, 1, 2, 3, 4, 6]))


@pytest.mark.parametrize(
    ("rest", "is_engaged"), [("engaged: force > 0\n", False), ("engaged: gap < 9\n", True), ("", True)]
)
def test_the_last_step_says_whether_the_controller_drives(write: Write, rest: str, is_engaged: bool) -> None:
    """By the manifest's condition; without one, nothing says that it does not."""
    manifest = write(f"hazards: {{HIT: {{when: gap < -9}}}}\n{rest}")
    assert judged(manifest).is_engaged_at_end is is_engaged
    trace = {"time": T, "gap": GAP, "speed": SPEED, "force": SPEED}
    assert is_engaged_at_end(manifest, trace) is is_engaged
