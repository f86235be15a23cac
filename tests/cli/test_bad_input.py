"""Errors for mistakes in specs, templates, options and run folders."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json

SPEC = """\
schema: fault_spec/1
module: sensor
fault_type: own
about: A custom fault.
variants:
  it:
    aim: H1
    about: Something.
    draw:
      error_m: {values: [30]}
    as_described:
      injections:
        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: gap}
          model: offset
          unit: m
          params: {by_m: error}
"""


@pytest.fixture
def own(root: Path) -> Path:
    own = Path("own.yaml")
    own.write_text(SPEC)
    return own


def test_the_spec_without_a_mistake_is_valid(cli: Cli, own: Path) -> None:
    assert cli("diff", own).code == 0


@pytest.mark.parametrize(
    ("right", "wrong", "line", "said"),
    [
        ("after_assign: gap", "after_assign: gab", 13, "gap"),  # unknown anchor
        ("toycar/sensing.py, function: Sensor.sense, after_assign: gap",
         "toycar/driver.py, function: Driver.drive, after_assign: wanted", 13, "nth"),  # ambiguous anchor
        ("toycar/sensing.py", "../../outside.py", 13, "outside"),  # outside the target's root
        ("toycar/sensing.py", "toycar/world.py", 13, "toycar/world.py"),  # a forbidden location
        ("by_m: error", "by_kph: error", 16, "by_m"),  # a unit of another dimension
        ("error_m: {values", "error_s: {values", 16, "by_m"),  # a draw of another dimension
        ("by_m: error", "by_m: far", 16, "error"),  # not a number
        ("model: offset", "model: ofset", 14, "offset"),  # unknown model
        ("aim: H1", "aim: H2", 7, "TOO_FAST"),  # a hazard that the target does not have
        ("aim: H1", "aims: H1", 7, "aim"),  # unknown key
        ("    about: Something.", "    about: Something.\n    about: Else.", 9, "about"),  # a key twice
        ("values: [30]", "values: [far]", 10, "number"),  # wrong type
        ("fault_spec/1", "fault_spec/2", 1, "fault_spec/1"),  # newer schema
        ("module: sensor", "module: [sensor", 3, "own.yaml"),  # not YAML
    ],
)  # fmt: skip
def test_a_mistake_in_a_spec_is_reported_with_its_line(
    cli: Cli, own: Path, right: str, wrong: str, line: int, said: str
) -> None:
    assert right in SPEC
    own.write_text(SPEC.replace(right, wrong))
    answer = cli("diff", own)
    assert answer.code == 2
    assert answer.err.startswith(f"error: own.yaml:{line}: ")
    assert said in answer.err
    assert "Traceback" not in answer.err


def test_a_value_out_of_range_is_refused(cli: Cli, own: Path) -> None:
    flip = SPEC.replace("model: offset", "model: bit_flip").replace("          unit: m\n", "")
    own.write_text(flip.replace("by_m: error", "bit: 64"))
    answer = cli("diff", own)
    assert answer.code == 2
    assert "64" in answer.err
    assert "63" in answer.err


def test_a_template_that_does_not_parse_is_reported_with_its_line(cli: Cli, own: Path, root: Path) -> None:
    template = root / "templates" / "offset.py.j2"
    template.write_text(template.read_text() + "{% if %}\n")
    for words in (["diff", own], ["check"]):
        answer = cli(*words)
        assert answer.code == (2 if words[0] == "diff" else 1)
        assert "offset.py.j2:" in answer.out + answer.err
        assert "Traceback" not in answer.err


def test_a_mutant_that_does_not_compile_is_not_run(cli: Cli, own: Path, root: Path) -> None:
    template = root / "templates" / "offset.py.j2"
    template.write_text("if _fi.active('{{ fi }}'):\n    {{ target }} = = {{ by }}\n")
    answer = cli("try", own, "-s", "A")
    assert answer.code == 2
    assert "own.yaml:13: " in answer.err
    assert "invalid syntax" in answer.err
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["try", "own.yaml", "-s", "A", "--trigger", "nan"], "time nan"),
        (["diff", "own.yaml", "--trigger", "1e999"], "time inf"),
        (["diff", "own.yaml", "--trigger", "near"], "one of near_far/near, other/near"),
        (["plan", "toy", "--out", "p", "--seed", str(2**63)], f"seed {2**63}"),
        (["try", "own.yaml", "-s", "A", "--out", "own.yaml/x"], "own.yaml/x"),
        (["generate", "own.yaml", "--out", "own.yaml"], "cannot be written"),
    ],
)
def test_an_invalid_option_is_reported(cli: Cli, own: Path, root: Path, words: list[str], said: str) -> None:
    contexts = root / "fault_library" / "stpa" / "contexts"
    other = (contexts / "near_far.yaml").read_text().replace("name: near_far", "name: other")
    (contexts / "other.yaml").write_text(other)
    answer = cli(*words)
    assert answer.code == 2, answer.err
    assert said in answer.err
    assert "Traceback" not in answer.err
    assert cli("diff", "own.yaml", "--trigger", "other/near").code == 0


def test_an_injected_line_that_raises_is_shown(cli: Cli, own: Path, root: Path) -> None:
    template = root / "templates" / "offset.py.j2"
    template.write_text("if _fi.active('{{ fi }}'):\n    {{ target }} = [][int({{ by }})]\n")
    answer = cli("try", own, "-s", "A")
    assert answer.code == 0
    assert "verdict: invalid_mutant" in answer.out
    assert re.search(
        r"^toycar/\w+\.py:\d+: the injected `gap = .*` ended the run: IndexError", answer.out, re.M
    )
    assert cli("try", own, "-s", "A", "--json").json["error"]["kind"] == "IndexError"


def test_a_run_folder_of_a_newer_schema_is_refused(cli: Cli, root: Path) -> None:
    cli("plan", "toy", "--out", "runs/p", "--limit", "2")
    head = Path("runs/p/run.json")
    data = json.loads(head.read_text())
    head.write_text(json.dumps(data | {"schema": "run/999"}))
    for words in (
        ["report", "runs/p"],
        ["run", "toy", "--out", "runs/p"],
        ["show", "abcd"],
        ["clean", "runs/p", "-y"],
    ):
        answer = cli(*words)
        assert answer.code == 2, words
        assert "run/999" in answer.err
        assert "newer" in answer.err
    assert head.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["diff", "own.yaml", "--trigger", "near >"], "error: --trigger: "),
        (["plan", "toy", "--out", "own.yaml"], "to do: choose another --out"),
        (["plan", "toy", "--out", "p", "--only", "value > 1e9"], "to do: widen --only or the campaign"),
        (["run", "toy", "--out", "p", "--shard", "3/2"], "error: --shard: '3/2'"),
        (["list", "--library", "gone"], "to do: correct --library or MUTATOR_LIBRARY, --root or"),
    ],
)
def test_errors_name_the_options_of_the_command_line(
    cli: Cli, own: Path, root: Path, words: list[str], said: str
) -> None:
    answer = cli(*words)
    assert answer.code == 2, answer.err
    assert said in answer.err
    assert "`" not in answer.err.partition("to do")[2]


def test_errors_about_the_target_name_the_option_manifest(cli: Cli, own: Path, root: Path) -> None:
    """The option --target gives the controller's source."""
    targets = root / "fault_library" / "targets"
    text = (targets / "toycar.yaml").read_text()
    (targets / "other.yaml").write_text(text.replace("name: toycar", "name: other", 1))
    answer = cli("diff", "own.yaml")
    assert answer.err.startswith("error: --manifest: 2 targets in the library (other, toycar)")
