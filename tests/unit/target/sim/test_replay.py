"""The comparison of traces with references, on synthetic files with known differences."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from selfdrive.common.conversions import KPH_TO_MS
from selfdrive.common.errors import ConfigError
from selfdrive.sim.compare.key_figures import compute_key_figures, figure_difference
from selfdrive.sim.compare.tolerances import Tolerances, load_tolerances
from selfdrive.sim.compare.trace_comparison import compare_trace, find_crossings, time_lag_s
from selfdrive.sim.compare.trace_csv import COLUMNS, load_reference_trace, save_reference_trace
from selfdrive.sim.recorder import CHANNELS, INTEGER_CHANNELS, PLAN_SOURCES
from selfdrive.sim.replay import TOLERANCES_PATH, main

REPO = Path(__file__).parents[4]
TRACES = Path(os.environ.get("OPENPILOT_TRACES", REPO.parent / "shared/reference/openpilot_v0.4.2/traces"))

STEPS = 1000
NO_LIMITS = Tolerances(channel_limits={}, figure_limits={})
TABLE = "schema: replay-tolerances/1\nchannels:\n  v_ego: {v_ego}\nfigures:\n  engaged_s: 0.02\n"


@pytest.fixture
def trace():
    t = np.arange(STEPS) / 100
    channels = {name: np.zeros(STEPS) for name in CHANNELS}
    channels |= {"t": t, "v_ego": 20.0 + 3.0 * np.sin(t), "d_rel": 50.0 - 2.0 * t, "v_cruise": 97 * KPH_TO_MS}
    channels["v_cruise"] = np.full(STEPS, 97 * KPH_TO_MS)
    channels["hwt"] = channels["d_rel"] / channels["v_ego"]
    channels["engaged"] = (t >= 1.3).astype(float)
    channels["lead_status"] = np.ones(STEPS)
    return {
        name: values.astype(np.int32) if name in INTEGER_CHANNELS else values
        for name, values in channels.items()
    }


@pytest.fixture
def reference(trace, tmp_path):
    save_reference_trace(tmp_path / "made" / "S1.csv", trace)
    return load_reference_trace(tmp_path / "made" / "S1.csv")


@pytest.fixture
def finished(trace, tmp_path):
    def put(**changes):
        folder = tmp_path / "runs" / "S1"
        folder.mkdir(parents=True, exist_ok=True)
        record = {"scenario": "S1", "no_lead": False, "plant": "reference"}
        (folder / "record.json").write_text(json.dumps(record | changes.pop("record", {})))
        np.savez(folder / "trace.npz", **(trace | changes))
        return folder.parent

    return put


def channel(comparison, name):
    return next(result for result in comparison.channel_comparisons if result.column.channel == name)


def replay(reference, runs, *arguments):
    return main(["--references", str(reference.path.parent), "--runs", str(runs), *arguments])


def test_a_written_reference_is_read_back(trace, reference):
    assert list(reference.steps) == list(range(0, STEPS, 5))
    for column in COLUMNS:
        if column.channel != "fcw":
            assert reference.channels[column.channel] == pytest.approx(trace[column.channel][::5], rel=1e-5)
    comparison = compare_trace(reference, trace, NO_LIMITS)
    assert all(result.rms < 1e-4 for result in comparison.channel_comparisons)


def test_rms_and_largest_difference(trace, reference):
    trace["v_ego"] = trace["v_ego"].copy()
    trace["v_ego"][300:400] -= 0.5
    trace["v_ego"][350] -= 0.1
    found = channel(compare_trace(reference, trace, NO_LIMITS), "v_ego")
    assert found.rms == pytest.approx(np.sqrt((19 * 0.5**2 + 0.6**2) / 200), abs=1e-4)
    assert found.peak_difference == pytest.approx(-0.6, abs=1e-4)
    assert found.peak_at_s == 3.5


@pytest.mark.parametrize("late", [0, 3, 50, -20])
def test_the_lag_of_a_delayed_wave(trace, late):
    steps = np.arange(0, STEPS, 5)
    wave = 3.0 * np.sin((np.arange(STEPS) - late) / 100)
    assert time_lag_s(steps, 3.0 * np.sin(steps / 100), wave) == pytest.approx(late / 100, abs=0.011)


def test_a_constant_has_no_lag_and_a_slope_has_lag_zero():
    steps = np.arange(0, STEPS, 5)
    assert time_lag_s(steps, np.ones(len(steps)), np.ones(STEPS)) is None
    assert time_lag_s(steps, steps / 100, np.arange(STEPS) / 100) == 0.0


def test_crossings_of_a_band():
    seconds = np.arange(8) / 20
    found = find_crossings(seconds, np.array([0.2, 0.5, 0.6, -0.9, 0.5, 0.0, 0.0, 0.7]), 0.5)
    assert [(one.begin_s, one.end_s, one.largest_difference, one.largest_at_s) for one in found] == [
        (0.1, 0.15, -0.9, 0.15),
        (0.35, 0.35, 0.7, 0.35),
    ]


def test_a_message_can_be_a_cycle_late(trace, reference):
    reference.channels["v_ego_est"] = np.concatenate(([0.0], trace["v_ego"][4::5][: STEPS // 5 - 1]))
    trace["v_ego_est"] = trace["v_ego"]
    reference.channels["v_ego"] = reference.channels["v_ego_est"]
    comparison = compare_trace(reference, trace, NO_LIMITS)
    assert abs(channel(comparison, "v_ego_est").peak_difference) == pytest.approx(
        20.0
    )  # the first row has no earlier cycle
    assert channel(comparison, "v_ego_est").rms < channel(comparison, "v_ego").rms


def test_leads_are_compared_only_while_both_runs_have_one(trace, reference):
    trace["lead_status"] = np.where(np.arange(STEPS) < 500, 0, 1)
    trace["lead_d_rel"] = np.where(np.arange(STEPS) < 500, 99.0, 0.0)
    comparison = compare_trace(reference, trace, NO_LIMITS)
    assert channel(comparison, "lead_d_rel").rms == 0.0
    assert channel(comparison, "lead_status").rms == pytest.approx(np.sqrt(0.5))


def test_nan_exceeds_any_limit(trace, reference):
    trace["v_ego"] = np.where(np.arange(STEPS) == 500, np.nan, trace["v_ego"])
    assert channel(compare_trace(reference, trace, NO_LIMITS), "v_ego").rms == np.inf


def test_leads_are_not_compared_on_a_free_road(trace, reference):
    with_lead = {
        result.column.channel for result in compare_trace(reference, trace, NO_LIMITS).channel_comparisons
    }
    without = {
        result.column.channel
        for result in compare_trace(reference, trace, NO_LIMITS, free_road=True).channel_comparisons
    }
    assert with_lead - without == {"v_lead"}


def test_key_figures(trace):
    rows = {name: values[::5] for name, values in trace.items()}
    rows["v_ego"] = np.where(np.arange(200) > 190, 0.0, rows["v_ego"])
    rows["v_cruise"] = np.where(np.arange(200) < 100, 97, 104) * KPH_TO_MS
    rows["brake"] = np.linspace(0.0, 0.4, 200)
    figures = compute_key_figures(np.arange(0, STEPS, 5), rows)
    assert figures["engaged_s"] == (1.25, 1.3)
    assert figures["set_speeds_kph"] == (97.0, 104.0)
    assert figures["min_hwt_s"] == pytest.approx(rows["hwt"][:191].min())
    assert figures["min_d_rel_m"] == rows["d_rel"][-1]
    assert figures["max_brake"] == 0.4


@pytest.mark.parametrize(
    ("name", "reference", "ours", "expected"),
    [
        ("engaged_s", (1.30, 1.35), (1.31, 1.31), 0.0),
        ("engaged_s", (1.30, 1.35), (1.38, 1.38), 0.03),
        ("engaged_s", (1.30, 1.35), (1.26, 1.26), 0.04),
        ("engaged_s", None, (1.3, 1.3), np.inf),
        ("engaged_s", None, None, 0.0),
        ("set_speeds_kph", (97.0,), (97.0,), 0.0),
        ("set_speeds_kph", (97.0,), (96.0,), 1.0),
        ("set_speeds_kph", (97.0, 104.0), (97.0,), np.inf),
        ("max_brake", 0.3, 0.4, 0.1),
    ],
)
def test_difference_of_figures(name, reference, ours, expected):
    """Two spans differ by the gap between them, two lists by their worst pair.

    The difference is infinite if only one side has the figure.
    """
    assert figure_difference(name, reference, ours) == pytest.approx(expected)


def test_a_run_compared_with_itself_is_within_tolerance(reference, finished, capsys):
    assert replay(reference, finished()) == 0
    out = capsys.readouterr().out
    assert "S1: within tolerance" in out
    assert out.endswith("1 of 1 within tolerance\n")


def test_an_rms_above_its_limit_gives_code_1(reference, finished, trace, capsys):
    speed = trace["v_ego"].copy()
    speed[200:401] += 1.0
    assert replay(reference, finished(v_ego=speed), "--long") == 1
    out = capsys.readouterr().out
    assert "rms beyond" in out
    assert "beyond 0.15 from 2.00 to 4.00 s, most at" in out
    assert out.endswith("0 of 1 within tolerance; beyond it: S1\n")


@pytest.mark.parametrize(
    ("limits", "code"), [("{max: 0.9}", 1), ("{max: 1.1}", 0), ("{lag_s: 0.2}", 0), ("{lag_s: 0.1}", 1)]
)
def test_limits_of_a_channel(reference, finished, trace, tmp_path, limits, code):
    late = np.interp(trace["t"] - 0.15, trace["t"], trace["v_ego"])
    changed = late if "lag" in limits else trace["v_ego"] + (np.arange(STEPS) == 500)
    table = tmp_path / "table.yaml"
    table.write_text(TABLE.replace("{v_ego}", limits))
    assert replay(reference, finished(v_ego=changed), "--tolerances", str(table)) == code


def test_a_key_figure_beyond_its_limit_gives_code_1(reference, finished, trace, capsys):
    assert replay(reference, finished(v_cruise=np.full(STEPS, 96 * KPH_TO_MS))) == 1
    assert "difference 1.000, limit 0  <-- beyond" in capsys.readouterr().out


def test_references_change_only_with_the_flag(reference, finished, trace, capsys):
    before = reference.path.read_bytes()
    runs = finished(v_ego=trace["v_ego"] + 1.0)
    assert replay(reference, runs) == 1
    assert reference.path.read_bytes() == before
    assert replay(reference, runs, "--update-references") == 0
    assert reference.path.read_bytes() != before
    assert replay(reference, runs) == 0


def test_without_finished_runs_the_scenario_is_simulated(tmp_path, scenarios):
    text = (scenarios / "S1.yaml").read_text().replace("duration_s: 30", "duration_s: 2")
    (tmp_path / "S1.yaml").write_text(text)
    given = ["--references", str(tmp_path / "kept"), "--scenarios", str(tmp_path)]
    assert main([*given, "S1", "S1_nolead", "--update-references"]) == 0
    assert sorted(path.name for path in (tmp_path / "kept").iterdir()) == ["S1.csv", "S1_nolead.csv"]
    assert main(given) == 0


@pytest.mark.parametrize(
    ("line", "old", "new", "expected"),
    [
        (1, "speed,", "sped,", "unknown column 'sped'"),
        (1, "speed,", "d_rel,", "column 'd_rel' twice"),
        (1, "time,", "", "`time` and at least one channel"),
        (2, "20,", "fast,", "speed: 'fast'"),
        (2, "20,", "nan,", "speed: 'nan'"),
        (2, "20,", "", "cells"),
        (2, PLAN_SOURCES[0], "mpc9", "plan_source: 'mpc9'"),
        (3, "0.05,", "0.051,", "a multiple of 0.01 s"),
        (3, "0.05,", "0,", "ascending times"),
    ],
)
def test_the_error_for_a_wrong_reference_file_gives_its_line(
    reference, finished, capsys, line, old, new, expected
):
    lines = reference.path.read_text().splitlines()
    assert old in lines[line - 1]
    lines[line - 1] = lines[line - 1].replace(old, new, 1)
    reference.path.write_text("\n".join(lines))
    assert replay(reference, finished()) == 2
    error = capsys.readouterr().err
    assert f"S1.csv:{line}: " in error
    assert expected in error


def test_a_reference_saved_by_a_spreadsheet_is_read(reference, finished):
    """A byte order mark before the first column's name is ignored."""
    reference.path.write_bytes(b"\xef\xbb\xbf" + reference.path.read_bytes())
    assert list(load_reference_trace(reference.path).channels) == list(reference.channels)
    assert replay(reference, finished()) == 0


def test_a_reference_of_another_length_is_refused(trace, reference):
    for steps in (STEPS - 100, STEPS + 100):
        cut = {name: np.resize(values, steps) for name, values in trace.items()}
        with pytest.raises(ConfigError, match="the last row is at"):
            compare_trace(reference, cut, NO_LIMITS)


def test_a_channel_with_a_limit_must_exist(trace, reference):
    tolerances = load_tolerances(TOLERANCES_PATH)
    reference.channels["d_rel"][:] = np.nan
    with pytest.raises(ConfigError, match="nothing in column 'd_rel'"):
        compare_trace(reference, trace, tolerances)
    del reference.channels["d_rel"]
    with pytest.raises(ConfigError, match="no column 'd_rel'"):
        compare_trace(reference, trace, tolerances)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (TABLE.replace("v_ego:", "v_eg:"), "table.yaml:3: unknown key 'v_eg'"),
        (TABLE.replace("{v_ego}", "{rms: -1}"), "table.yaml:3: rms: '-1'"),
        (TABLE.replace("{v_ego}", "{}"), "table.yaml:3: no limit"),
        (TABLE.replace("/1", "/9"), "table.yaml:1: schema"),
        (TABLE.replace("engaged_s", "engaged"), "table.yaml:5: unknown key 'engaged'"),
        ("", "table.yaml:1: an empty file, expected a mapping; write the keys schema, channels, figures"),
    ],
)
def test_a_wrong_tolerance_table_is_refused(reference, finished, tmp_path, capsys, text, expected):
    (tmp_path / "table.yaml").write_text(text.replace("{v_ego}", "{rms: 0.1}"))
    assert replay(reference, finished(), "--tolerances", str(tmp_path / "table.yaml")) == 2
    assert expected in capsys.readouterr().err


def test_wrong_folders_and_names_are_refused(reference, finished, tmp_path, capsys):
    assert main(["--references", str(tmp_path / "nowhere")]) == 2
    assert main(["--references", str(reference.path.parent), "X9"]) == 2
    assert main(["--references", str(reference.path.parent), "--scenarios", str(tmp_path)]) == 2
    assert replay(reference, tmp_path / "nowhere") == 2
    assert replay(reference, finished(record={"plant": "standard"})) == 2
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 5
    assert "a run of S1 on the standard plant, expected a run of S1 on the reference plant" in errors[-1]


def test_the_projects_table_has_the_agreed_limits():
    tolerances = load_tolerances(TOLERANCES_PATH)
    assert tolerances.channel_limits["v_ego"].rms == 0.15
    assert tolerances.channel_limits["d_rel"].rms == 0.5
    assert tolerances.figure_limits == {
        "engaged_s": 0.02,
        "set_speeds_kph": 0.0,
        "min_hwt_s": 0.05,
        "min_d_rel_m": 1.0,
        "max_brake": 0.08,
    }


@pytest.mark.slow
def test_all_recorded_traces_are_within_tolerance(capsys):
    if not any(TRACES.glob("*.csv")):
        pytest.skip(f"no recorded runs in {TRACES}; set OPENPILOT_TRACES to their folder")
    code = main(["--references", str(TRACES)])
    assert code == 0, capsys.readouterr().out
