"""Scenario files: their meaning and the errors for mistakes."""

import pytest
from selfdrive.common.errors import ConfigError
from selfdrive.sim.scenario import ButtonPress, load_scenario, parse_scenario

GOOD = """\
schema: scenario/1
name: T1
title: a try
duration_s: 12.5
host:
  speed_mph: 60
  lateral_offset_m: -0.4
lead:
  gap_m: 80
  speed_kph: [36, 72]
  at_s: [0, 10]
buttons:
  - {button: decel_set, press_s: 1.2, release_s: 1.3}
  - {button: cancel, press_s: 5, release_s: 5.1}
road:
  grade: {at_s: [0, 5], mps2: [0, 1]}
  curvature: {at_m: [0, 100], per_m: [0, 0.002]}
"""


def parse(text):
    return parse_scenario(text, "some/file.yaml", "digest")


def edit(old, new):
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def test_all_values_are_converted_to_si_units():
    scenario = parse(GOOD)
    assert (scenario.name, scenario.title, scenario.digest, scenario.steps) == ("T1", "a try", "digest", 1250)
    assert scenario.speed == pytest.approx(26.8224)
    assert scenario.lateral_offset == -0.4
    assert scenario.lead.gap == 80.0
    assert scenario.lead.speeds == pytest.approx((10.0, 20.0))
    assert scenario.lead.times == (0.0, 10.0)
    assert scenario.buttons == (
        ButtonPress(button_code=3, press_step=120, release_step=130),
        ButtonPress(button_code=2, press_step=500, release_step=510),
    )
    assert scenario.grade == ((0.0, 5.0), (0.0, 1.0))
    assert scenario.curvature == ((0.0, 100.0), (0.0, 0.002))


def test_buttons_are_down_from_press_to_release():
    scenario = parse(GOOD)
    assert [scenario.button(k) for k in (119, 120, 129, 130, 505)] == [0, 3, 3, 0, 2]


def test_optional_keys_can_be_left_out():
    scenario = parse("schema: scenario/1\nname: a\ntitle: b\nduration_s: 1\nhost: {speed_mps: 5}\n")
    assert (scenario.lead, scenario.buttons, scenario.grade, scenario.curvature) == (None, (), None, None)
    assert (scenario.speed, scenario.lateral_offset) == (5.0, 0.0)
    single = parse(edit("  speed_kph: [36, 72]\n  at_s: [0, 10]\n", "  speed_kph: 36\n"))
    assert (single.lead.times, single.lead.speeds) == ((0.0,), (10.0,))


@pytest.mark.parametrize(
    ("text", "line", "got", "remedy"),
    [
        (edit("gap_m", "gap_ft"), 9, "unknown key 'gap_ft'", "did you mean 'gap_m'?"),
        (edit("name: T1", "name: T1\nname: T2"), 3, "key 'name' a second time", "remove one"),
        (edit("speed_mph: 60", "speed: 60"), 6, "unknown key 'speed'", "did you mean"),
        (
            edit("speed_mph: 60", "speed_mph: 60\n  speed_kph: 96"),
            6,
            "speed_kph and speed_mph",
            "one of these keys",
        ),
        (edit("  speed_mph: 60\n", ""), 6, "no speed", "one of these keys"),
        (edit("speed_mph: 60", "speed_mph: fast"), 6, "speed_mph: 'fast'", "a speed in mph"),
        (edit("speed_mph: 60", "speed_mph: .nan"), 6, "speed_mph: '.nan'", "a speed in mph"),
        (edit("speed_mph: 60", "speed_mph: -1"), 6, "speed_mph: '-1'", "a speed in mph"),
        (edit("speed_mph: 60", "speed_mph: '60'"), 6, "speed_mph: '60'", "a speed in mph"),
        (edit("speed_mph: 60", "speed_mph: [60]"), 6, "speed_mph: a list", "a speed in mph"),
        (edit("speed_mph: 60", "speed_mph: yes"), 6, "speed_mph: 'yes'", "a speed in mph"),
        (edit("speed_mph: 60", "speed_mph: 1:00"), 6, "speed_mph: '1:00'", "a speed in mph"),
        (edit("speed_mph: 60", "speed_mph: 0x3c"), 6, "speed_mph: '0x3c'", "a speed in mph"),
        (edit("speed_mph: 60", "speed_mph: !!float x"), 6, "speed_mph: 'x'", "a speed in mph"),
        (edit("speed_mph: 60", "speed_mph: 6" + 5000 * "0"), 6, "speed_mph: '6000", "a speed in mph"),
        (edit("release_s: 1.3", "release_s: 1.234"), 13, "release_s: '1.234'", "10 ms"),
        (edit("duration_s: 12.5", "duration_s: 12.503"), 4, "duration_s: '12.503'", "10 ms"),
        (edit("duration_s: 12.5", "duration_s: 1e9"), 4, "duration_s: '1e9'", "length of the run"),
        (edit("duration_s: 12.5\n", ""), 1, "no 'duration_s'", "length of the run"),
        (edit("scenario/1", "scenario/2"), 1, "schema: 'scenario/2'", "scenario/1"),
        (edit("name: T1", "name: 1"), 2, "name: '1'", "short name"),
        (edit("at_s: [0, 10]", "at_s: [0, 10, 20]"), 11, "at_s: a list", "one for each speed"),
        (edit("at_s: [0, 10]", "at_s: [10, 0]"), 11, "at_s: 0 after 10", "in order"),
        (edit("[36, 72]", "36"), 11, "at_s: a list", "give a list of speeds"),
        (edit("[36, 72]", "[]"), 10, "speed_kph: a list", "[a, b, ...]"),
        (edit("  at_s: [0, 10]\n", ""), 9, "no 'at_s'", "times of the speeds"),
        (edit("button: decel_set", "button: decelset"), 13, "button: 'decelset'", "decel_set"),
        (edit("release_s: 1.3", "release_s: 1.1"), 13, "release_s: '1.1'", "release it later"),
        (edit("press_s: 5,", "press_s: 1.25,"), 14, "press_s: '1.25'", "in order"),
        (edit("mps2: [0, 1]", "mps2: [0, 1, 2]"), 16, "at_s: a list", "one for each value"),
        (edit("per_m: [0, 0.002]", "per_m: [0, 2]"), 17, "per_m: '2'", "curvature in 1/m"),
        (edit("host:", "host: 3\nhosts:"), 6, "unknown key 'hosts'", "did you mean 'host'?"),
        (edit("host:\n  speed_mph: 60\n  lateral_offset_m: -0.4\n", "host: 3\n"), 5, "'3'", "give the keys"),
        (edit("name: T1", "name: [T1"), 3, "", "correct the syntax"),
        ("", 1, "an empty file", "write the keys"),
        ("- a\n", 1, "a list", "give the keys"),
    ],
)
def test_the_error_for_a_mistake_gives_place_and_remedy(text, line, got, remedy):
    with pytest.raises(ConfigError) as caught:
        parse(text)
    message = str(caught.value)
    assert message.startswith(f"some/file.yaml:{line}: {got}")
    assert ", expected " in message
    assert remedy in message.rsplit("; ", 1)[1]


def test_numbers_have_their_usual_meaning():
    """YAML 1.1 would read a leading zero as octal."""
    for text in ("60", "060", "60.", "+6.0e1"):
        assert parse(edit("speed_mph: 60", f"speed_mph: {text}")).speed == pytest.approx(26.8224)


def test_unreadable_files_are_refused(tmp_path):
    (tmp_path / "deep.yaml").write_text("a: " + 5000 * "[")
    with pytest.raises(ConfigError, match=r"deep\.yaml: nested too deeply, expected valid YAML"):
        load_scenario(tmp_path / "deep.yaml")
    with pytest.raises(ConfigError, match=r"no\.yaml: No such file"):
        load_scenario(tmp_path / "no.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"binary\.yaml: not UTF-8 text"):
        load_scenario(tmp_path / "binary.yaml")


@pytest.mark.parametrize("name", ["S1", "S2", "S3", "S4", "S5"])
def test_the_five_scenarios_have_the_expected_values(scenarios, name):
    scenario = load_scenario(scenarios / f"{name}.yaml")
    assert (scenario.name, scenario.steps, scenario.speed) == (name, 3000, pytest.approx(26.8224))
    assert scenario.lead.gap == 100.0
    assert scenario.lead.speeds[0] == pytest.approx(25 * 0.44704 if name == "S2" else 40 * 0.44704)
    assert scenario.buttons == (ButtonPress(button_code=3, press_step=120, release_step=130),)


def test_the_digest_changes_even_with_a_comment(tmp_path):
    first, second = tmp_path / "a.yaml", tmp_path / "b.yaml"
    first.write_text(GOOD)
    second.write_text(GOOD + "# more\n")
    assert load_scenario(first).digest != load_scenario(second).digest
