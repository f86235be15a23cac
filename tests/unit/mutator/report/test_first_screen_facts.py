"""The worst experiment and the four numbers of a report's first screen."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from mutator._common.message_text import with_unbreakable_numbers
from mutator.model import Status
from mutator.report.first_screen_facts import key_numbers, worst_record, worst_row
from mutator.report.panels.first_screen_panel import build_first_screen_panel
from mutator.report.reported_run import ReportedRun
from mutator.store.run_folder import RunFolder

from .made_run import make_run

SILENT, LATE, WARNED = "no alert at all", "alert only after the hazard", "alert before the hazard"
#  outcome, t_activation, t_manifest, t_hazard, warning
RUNS = [
    ("hazard", 2.0, 2.1, 3.5, SILENT),
    ("hazard", 2.0, 2.1, 6.0, LATE),
    ("hazard", 2.0, 2.1, 4.0, WARNED),
    ("sdc", 2.0, 2.1, None, ""),
    ("masked", 2.0, None, None, ""),
    ("not_activated", None, None, None, ""),
]


@pytest.fixture
def frame() -> pd.DataFrame:
    names = ["outcome", "t_activation", "t_manifest", "t_hazard", "warning"]
    frame = pd.DataFrame(RUNS, columns=names).astype(dict.fromkeys(names[1:4], float))
    flags = {f"is_{flag}": frame[f"t_{time}"].notna() for flag, time in TIMES.items()}
    return frame.assign(fault_id=[f"f{i}" for i in frame.index], **flags)


TIMES = {"activated": "activation", "manifested": "manifest"}


def test_each_number_has_its_counts_its_interval_and_its_list(frame: pd.DataFrame) -> None:
    """The intervals are Wilson's, computed by hand: of 5 of 6, 3 of 5 and 2 of 3."""
    acted, dangerous, silent, time = key_numbers(frame, has_alerts=True)
    assert (acted.value, acted.evidence) == ("83 %", "5 of 6; 95 % interval 44 to 97 %")
    assert acted.fragment == "q=t_activation%3E%3D0"
    assert (dangerous.value, dangerous.evidence) == ("60 %", "3 of 5; 95 % interval 23 to 88 %")
    assert (silent.value, silent.evidence) == ("67 %", "2 of 3; 95 % interval 21 to 94 %")
    assert silent.fragment == "warning=no%20alert%20at%20all,alert%20only%20after%20the%20hazard"
    assert silent.percents == pytest.approx((66.67, 20.77, 93.85), abs=0.01)
    assert time.value == "2.00 s"
    assert time.evidence == "95 % interval 1.50 to 4.00 s; 1.50 s at the soonest"
    assert (time.percents, time.fragment) == (None, "outcome=hazard&sort=time_to_hazard")


def test_a_target_without_alerts_has_no_silent_hazards(frame: pd.DataFrame) -> None:
    third = key_numbers(frame, has_alerts=False)[2]
    assert (third.value, third.meaning) == ("80 %", "of the activated faults changed an actuator")


def test_a_number_without_a_base_has_no_value_and_no_interval(frame: pd.DataFrame) -> None:
    numbers = key_numbers(frame[5:], has_alerts=True)
    assert [number.value for number in numbers] == ["0 %", "-", "-", "-"]
    assert [number.evidence for number in numbers[1:]] == [
        "there were no activated faults",
        "there were no hazards",
        "there were no hazards",
    ]
    assert {number.fragment for number in numbers} == {""}


def test_times_of_one_fault_have_no_interval(frame: pd.DataFrame) -> None:
    time = key_numbers(frame.assign(fault_id="f0"), has_alerts=True)[3]
    assert time.evidence == "no interval: too few different faults; 1.50 s at the soonest"


def test_rates_of_a_sample_are_weighted_and_say_so(frame: pd.DataFrame) -> None:
    """Five faults acted, three of them hazardous. The first stands for six, each other one for itself."""
    weighted = frame.assign(weight=[6.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    acted, dangerous, silent, _ = key_numbers(weighted, has_alerts=True)
    assert (acted.value, dangerous.value, silent.value) == ("91 %", "80 %", "88 %")
    assert dangerous.evidence.startswith("3 of 5 drawn; weighted; 95 % interval ")


def test_a_sample_without_strata_has_counts_instead_of_rates(frame: pd.DataFrame) -> None:
    numbers = key_numbers(frame.assign(weight=float("nan")), has_alerts=True)[:3]
    assert [number.value for number in numbers] == ["5 of 6", "3 of 5", "2 of 3"]
    assert {number.percents for number in numbers} == {None}


def test_the_worst_usable_experiment_is_the_first(tmp_path: Path) -> None:
    run = ReportedRun.open(RunFolder.open(make_run(tmp_path)), None)
    worst = worst_row(run)
    assert worst is not None and worst.experiment_id == "0" * 16
    panel = build_first_screen_panel(run)
    assert (
        with_unbreakable_numbers("radar/chaff/distance 35.0 m") in panel.html
        and 'href="#e=0000000000000000"' in panel.html
    )
    assert panel.markdown.startswith(
        "**The worst experiment:** radar/chaff/distance 35.0 m in S1, trigger C2"
    )
    assert worst_record(run) is None  # this made-up run has no records


def test_a_run_without_a_usable_experiment_has_no_worst_one(tmp_path: Path) -> None:
    run = ReportedRun.open(RunFolder.open(make_run(tmp_path)), None)
    failed = run.results.assign(status=Status.HARNESS_ERROR.value, outcome="")
    assert worst_row(replace(run, results=failed)) is None
