"""The sentence about an experiment, as a table of rows and texts."""

from dataclasses import replace
from typing import Any

import pytest

from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Injection, Value
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.targets.stored_phrases import Phrases
from mutator.targets.stored_target_facts import HazardFacts

PHRASES = Phrases(
    faults={
        "sensors/speed/slower": {"": ("the speed sensor reads {abs_value} too low",)},
        "sensors/speed/coded": {"": ("the speed sensor reads {abs_by_kph} too low",)},
        "sensors/steer/angle": {
            "positive": ("the angle sensor reads {abs_value} too far left",),
            "negative": ("the angle sensor reads {abs_value} too far right",),
        },
    },
    models={
        "offset": {"": ("{by} is added to {changed} in {function}",)},
        "clamp": {"": ("{changed} is limited to {low} to {high}", "{changed} is at most {high}")},
    },
    situations={"C2": {"": ("while the car is close behind a slower lead",)}},
    hazards={
        "H1": {
            "": ("the car touches the lead {later} at {contact_speed}", "the car touches the lead {later}")
        },
        "H3": {"": ("the car leaves its lane {later}",)},
    },
    actuators={
        "gas": {
            "higher": ("the car accelerates to {highest_speed}", "the car gives more gas"),
            "lower": ("the car slows to {lowest_speed}", "the car gives less gas"),
        },
        "steer": {"higher": ("the car steers further left",), "lower": ("the car steers further right",)},
    },
)
SENTENCES = ExperimentSentences(
    phrases=PHRASES,
    hazards=(
        HazardFacts(name="H1", about="contact", terminal=True),
        HazardFacts(name="H2", about="the car has stopped", terminal=False),
        HazardFacts(name="H3", about="", terminal=False),
    ),
    unit_by_metric={"contact_speed": "m/s"},
    has_alerts=True,
    words_by_severity={"S2": "severe"},
)
SPEEDS = {
    "speed_at_activation": 26.8,
    "highest_speed": 37.02,
    "lowest_speed": 26.8,
    "golden_highest_speed": 27.0,
    "golden_lowest_speed": 20.0,
}
HAZARD = {
    "status": "ok", "outcome": "hazard", "t_activation": 24.6, "t_manifest": 24.7, "condition": "t >= 24.6",
    "hold": "to_end", "first_actuator": "gas", "first_change": "higher", "t_h1": 29.06, "t_end": 29.06,
    "contact_speed": 19.6, "severity": "S2", "alerts": "", "trigger": "random/C2",
} | SPEEDS  # fmt: skip
NO_HAZARD = HAZARD | {"outcome": "sdc", "t_h1": None, "t_end": None, "contact_speed": None, "severity": ""}
NEVER = {"status": "ok", "outcome": "not_activated", "t_activation": None}
START = "The speed sensor reads 50 mph too low from 24.60 s."
DRIVE = "The car accelerates to 37.02 m/s and touches the lead 4.46 s later"
CASES: dict[str, tuple[dict[str, Any], str]] = {
    "a hazard": (HAZARD, f"{START} {DRIVE} at 19.60 m/s (severe). No alert."),
    "an alert before": (
        HAZARD | {"alerts": "fcw;late", "t_alert": 27.0},
        f"{START} {DRIVE} at 19.60 m/s (severe). Alert fcw 2.06 s before the hazard.",
    ),
    "an alert after": (
        HAZARD | {"alerts": "fcw", "t_alert": 29.5},
        f"{START} {DRIVE} at 19.60 m/s (severe). Alert fcw only 0.44 s after the hazard.",
    ),
    "an alert in the same step": (
        HAZARD | {"alerts": "fcw", "t_alert": 29.06},
        f"{START} {DRIVE} at 19.60 m/s (severe). Alert fcw only in the moment of the hazard.",
    ),
    "a class without words": (
        HAZARD | {"severity": "S1"}, f"{START} {DRIVE} at 19.60 m/s (severity S1). No alert.",
    ),
    "no class of severity": (HAZARD | {"severity": ""}, f"{START} {DRIVE} at 19.60 m/s. No alert."),
    "a metric of another end of the drive": (
        HAZARD | {"t_end": 30.0, "severity": ""}, f"{START} {DRIVE}. No alert.",
    ),
    "two hazards": (
        HAZARD | {"t_h3": 30.5},
        f"{START} The car accelerates to 37.02 m/s, touches the lead 4.46 s later at 19.60 m/s and leaves "
        "its lane 1.44 s after that. Severity: severe. No alert.",
    ),
    "two hazards in one step": (
        HAZARD | {"t_h3": 29.06},
        f"{START} The car accelerates to 37.02 m/s, touches the lead 4.46 s later at 19.60 m/s and leaves "
        "its lane at the same time. Severity: severe. No alert.",
    ),
    "a hazard without a phrase": (
        NO_HAZARD | {"outcome": "hazard", "t_h2": 30.0},
        f"{START} The car accelerates to 37.02 m/s and hazard H2 (the car has stopped) occurs 5.40 s later. "
        "No alert.",
    ),
    "a hazard before any actuator differs": (
        HAZARD | {"t_manifest": 29.5, "severity": ""},
        f"{START} The car touches the lead 4.46 s later at 19.60 m/s. No alert.",
    ),
    "columns that an older run lacks": (
        {name: cell for name, cell in HAZARD.items() if name not in (*SPEEDS, "first_actuator")},
        f"{START} The car touches the lead 4.46 s later at 19.60 m/s (severe). No alert.",
    ),
    "a drive without a speed": (
        {name: cell for name, cell in HAZARD.items() if name not in SPEEDS},
        f"{START} The car gives more gas and touches the lead 4.46 s later at 19.60 m/s (severe). No alert.",
    ),
    "a golden run that is as fast": (
        NO_HAZARD | {"golden_highest_speed": 37.0},
        f"{START} The car gives more gas. No hazard follows. No alert.",
    ),
    "a car that slows": (
        NO_HAZARD | {"first_change": "lower", "lowest_speed": 11.73},
        f"{START} The car slows to 11.73 m/s. No hazard follows. No alert.",
    ),
    "a car that slows until it stands": (
        NO_HAZARD | {"first_change": "lower", "lowest_speed": 0.29},
        f"{START} The car slows to 0.29 m/s. No hazard follows. No alert.",
    ),
    "a hazard of a car that stands has one speed": (
        HAZARD | {"first_change": "lower", "lowest_speed": 0.29, "highest_speed": 26.8},
        f"{START} The car gives less gas and touches the lead 4.46 s later at 19.60 m/s (severe). No alert.",
    ),
    "an actuator that becomes NaN": (
        NO_HAZARD | {"first_change": "no_number"},
        f"{START} `gas` becomes NaN. No hazard follows. No alert.",
    ),
    "a first change that is the whole change": (
        NO_HAZARD | {"first_change": "lower", "highest_speed": 27.0, "first_change_share": 0.75},
        f"{START} The car gives less gas. No hazard follows. No alert.",
    ),
    "a first change, and then the opposite": (
        NO_HAZARD | {"first_change": "lower", "highest_speed": 27.0, "first_change_share": 0.74},
        f"{START} The car gives less gas at first, then gives more gas. No hazard follows. No alert.",
    ),
    "a first change, and then the opposite with a speed": (
        HAZARD | {"first_change": "lower", "first_change_share": 0.01},
        f"{START} The car gives less gas at first, then accelerates to 37.02 m/s and touches the lead "
        "4.46 s later at 19.60 m/s (severe). No alert.",
    ),
    "a first change, and then a speed of a car that stands": (
        HAZARD | {"lowest_speed": 0.29, "highest_speed": 26.8, "first_change_share": 0.01},
        f"{START} The car gives more gas at first, then slows to 0.29 m/s and touches the lead 4.46 s later "
        "at 19.60 m/s (severe). No alert.",
    ),
    "a first change that the speed confirms": (
        NO_HAZARD | {"first_change_share": 0.5},
        f"{START} The car accelerates to 37.02 m/s. No hazard follows. No alert.",
    ),
    "a first change that the speed contradicts": (
        NO_HAZARD | {"first_change": "lower", "first_change_share": 1.0},
        f"{START} The car gives less gas at first. No hazard follows. No alert.",
    ),
    "a speed that follows although another actuator came first": (
        NO_HAZARD | {"first_actuator": "steer", "highest_speed": 26.8, "lowest_speed": 11.73},
        f"{START} The car steers further left and slows to 11.73 m/s. No hazard follows. No alert.",
    ),
    "the larger one of two speeds, of which the lowest changed less": (
        NO_HAZARD | {"first_actuator": "steer", "highest_speed": 37.02, "lowest_speed": 17.0},
        f"{START} The car steers further left and accelerates to 37.02 m/s. No hazard follows. No alert.",
    ),
    "the larger one of two speeds, of which the highest changed less": (
        NO_HAZARD | {"first_actuator": "steer", "highest_speed": 37.02, "lowest_speed": 2.0},
        f"{START} The car steers further left and slows to 2.00 m/s. No hazard follows. No alert.",
    ),
    "two changes of an actuator without a phrase": (
        NO_HAZARD | {"first_actuator": "horn", "first_change": "lower", "first_change_share": 0.5},
        f"{START} `horn` is lower than in the golden run at first, then `horn` is higher than in the golden "
        "run. No hazard follows. No alert.",
    ),
    "an actuator without a phrase": (
        NO_HAZARD | {"first_actuator": "horn", "first_change": "lower"},
        f"{START} `horn` is lower than in the golden run. No hazard follows. No alert.",
    ),
    "an alert without a hazard": (
        NO_HAZARD | {"alerts": "fcw", "t_alert": 25.3},
        f"{START} The car accelerates to 37.02 m/s. No hazard follows. Alert fcw at 25.30 s.",
    ),
    "masked": (
        NO_HAZARD | {"outcome": "masked", "stopped_at": "radard;lkas"},
        f"{START} It changes no actuator: it stops at radard and lkas. No hazard follows. No alert.",
    ),
    "masked, nobody knows where": (
        NO_HAZARD | {"outcome": "masked"}, f"{START} It changes no actuator. No hazard follows. No alert.",
    ),
    "while a context holds": (
        NO_HAZARD | {"outcome": "masked", "hold": "while", "trigger": "C2", "condition": "hwt <= 2.0"},
        "The speed sensor reads 50 mph too low from 24.60 s while the car is close behind a slower lead. "
        "It changes no actuator. No hazard follows. No alert.",
    ),
    "while a condition holds": (
        NO_HAZARD | {"outcome": "masked", "hold": "while", "trigger": "when", "condition": "gap < 30"},
        "The speed sensor reads 50 mph too low from 24.60 s while gap < 30. It changes no actuator. "
        "No hazard follows. No alert.",
    ),
    "for a time": (
        NO_HAZARD | {"outcome": "masked", "hold": "for", "hold_s": 2.0},
        "The speed sensor reads 50 mph too low from 24.60 s for 2 s. It changes no actuator. "
        "No hazard follows. No alert.",
    ),
    "for a time, starting in a context": (
        NO_HAZARD
        | {"outcome": "masked", "hold": "for", "hold_s": 2.0}
        | {"trigger": "C2 for 2 s", "condition": "hwt <= 2.0"},
        "The speed sensor reads 50 mph too low from 24.60 s for 2 s, starting while the car is close behind "
        "a slower lead. It changes no actuator. No hazard follows. No alert.",
    ),
    "never active for a time in a context": (
        NEVER
        | {"condition": "hwt <= 2.0", "hold": "for", "hold_s": 2.0, "trigger": "C2"},
        "Planned: the speed sensor reads 50 mph too low for 2 s, starting while the car is close behind a "
        "slower lead. It was never active: the changed code did not run at any such time.",
    ),
    "never active after a time": (
        NEVER | {"condition": "t >= 24.63", "hold": "to_end"},
        "Planned: the speed sensor reads 50 mph too low from 24.63 s. It was never active: the changed code "
        "did not run then.",
    ),
    "never active in a context": (
        NEVER | {"condition": "hwt <= 2.0", "hold": "while", "trigger": "C2"},
        "Planned: the speed sensor reads 50 mph too low while the car is close behind a slower lead. "
        "It was never active: the changed code did not run at any such time.",
    ),
    "never active after a condition": (
        NEVER | {"condition": "gap < 30", "hold": "to_end"},
        "Planned: the speed sensor reads 50 mph too low once gap < 30. It was never active: the changed code "
        "did not run then.",
    ),
    "a crash": (
        {"status": "crashed", "t_activation": 24.6, "hold": "to_end", "detail": "ValueError: no number."},
        f"{START} The controller crashes: ValueError: no number.",
    ),
    "a timeout": (
        {"status": "timeout", "condition": "True", "detail": "60 s of CPU time"},
        "Planned: the speed sensor reads 50 mph too low. The run was stopped at a limit: 60 s of CPU time.",
    ),
    "an invalid mutant": (
        {"status": "invalid_mutant", "condition": "True", "detail": ""},
        "Planned: the speed sensor reads 50 mph too low. The mutant cannot run.",
    ),
    "a harness error": (
        {"status": "harness_error", "condition": "True", "detail": "disk full"},
        "Planned: the speed sensor reads 50 mph too low. The harness failed, so nothing is known about the "
        "fault: disk full.",
    ),
}  # fmt: skip


def fault(
    spec: str = "sensors/speed/slower", value: Value = 50, unit: str = "mph", **injection: Any
) -> Fault:
    anchor = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="speed")
    location = FaultLocation(path="sensors.py", function="measure", anchor=anchor)
    injections = (
        Injection(**{"location": location, "model": "offset", "params": (("by", -22.4),)} | injection),
    )
    return Fault(
        spec=spec, module="sensors", fault_type="speed", reading="as_described", value=value, unit=unit,
        aim="H1", injections=injections,
    )  # fmt: skip


@pytest.mark.parametrize(("row", "text"), CASES.values(), ids=list(CASES))
def test_a_row_has_its_sentence(row: dict[str, Any], text: str) -> None:
    """Each kind of ending, trigger, alert and missing column has exactly this sentence."""
    assert SENTENCES.sentence(row, fault()) == text


def test_empty_cells_and_nan_are_missing_values() -> None:
    """A frame has NaN and empty texts where a record has None."""
    row = NO_HAZARD | {"outcome": "masked", "t_h1": float("nan"), "t_alert": float("nan"), "alerts": ""}
    assert SENTENCES.sentence(row, fault()) == CASES["masked, nobody knows where"][1]


@pytest.mark.parametrize(
    ("injected", "text"),
    [
        (fault(), "the speed sensor reads 50 mph too low"),
        (fault("sensors/speed/coded"), "the speed sensor reads 22.4 km/h too low"),
        (fault("sensors/steer/angle", 12.34, "deg"), "the angle sensor reads 12.34 deg too far left"),
        (fault("sensors/steer/angle", -12.0, "deg"), "the angle sensor reads 12 deg too far right"),
        (fault("sensors/other/x"), "-22.4 is added to `speed` in `measure`"),
        (fault("sensors/other/x", model="clamp", params=(("high", 40.0),)), "`speed` is at most 40"),
        (fault("sensors/other/x", model="unknown"), "sensors/other/x 50 mph"),
    ],
)
def test_a_fault_has_the_words_of_its_spec_its_model_or_its_label(injected: Fault, text: str) -> None:
    """The first of these that exists is used; numbers have the unit of the spec or of the source."""
    assert SENTENCES.fault_clause(injected) == text


def test_a_name_keeps_its_letters() -> None:
    """A fault without words has its name in the sentence, with the letters that find it."""
    for spec in ("sensors/other/x", "Sensors/other/x"):
        named = fault(spec, model="unknown")
        assert SENTENCES.sentence(HAZARD, named).startswith(f"{spec} 50 mph from 24.60 s. The car ")
        planned = SENTENCES.sentence(NEVER | {"condition": "t >= 24.6"}, named)
        assert planned.startswith(f"Planned: {spec} 50 mph from 24.60 s. It was never active")


def test_a_target_without_alerts_has_no_word_about_them() -> None:
    """`No alert` would be a reproach to a target that has none."""
    silent = replace(SENTENCES, has_alerts=False)
    assert not silent.sentence(HAZARD, fault()).endswith("alert.")
