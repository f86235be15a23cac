"""Every mistake in a fault spec is reported at its line, with a remedy."""

import pytest

from mutator.config.units import UNIT_SUFFIXES_TEXT
from mutator.errors import MutatorError
from mutator.workspace import Workspace
from tests.unit.mutator.faults.toy_faults import faults


def edited(workspace: Workspace, old: str, new: str) -> str:
    path = workspace.library / "faults" / "sensor" / "distance.yaml"
    text = path.read_text()
    assert text.count(old) >= 1
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(MutatorError) as caught:
        faults(workspace)
    return str(caught.value).replace(f"{path}:", "")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "params: {by_m: error}",
            "params: {by_m: error, bye_m: 3}",
            "17: unknown parameter 'bye_m' of model offset; expected one of `target`, `by_m`, "
            "`low_m`, `high_m`; correct or remove it; did you mean 'by_m'?",
        ),
        (
            "params: {by_m: error}",
            "params: {by_deg: error}",
            "17: 'by_deg' (a unit of angle); expected `by_m`; end the key with the number's unit",
        ),
        (
            "params: {by_m: error}",
            "params: {by: error}",
            "17: 'by' (no unit); expected `by_m`; end the key with the number's unit",
        ),
        (
            "params: {by_m: error}",
            "params: {by_m: '35 m'}",
            "17: '35 m' for 'by_m'; expected a number, or 'error', the draw; correct the value",
        ),
        (
            "params: {by_m: error}",
            "params: {low_m: 0}",
            "17: parameter 'by' of model offset is missing; expected the constant to add; add `by_m`",
        ),
        (
            "params: {by_m: error}",
            "params: {by_m: error, target: d rel}",
            "17: 'd rel' for 'target'; expected a name as in the source; correct the value",
        ),
        (
            "params: {by_m: error}",
            'params: {by_m: error, target: "gap # or so"}',
            "17: 'gap # or so' for 'target'; expected a name as in the source; correct the value",
        ),
        (
            "after_assign: gap}\n          model: offset\n          unit: m\n          params: {by_m: error}",
            "assigned_value: gap}\n          model: offset\n          unit: m\n"
            "          params: {by_m: error, target: gap}",
            "17: 'gap' for 'target' at `assigned_value`; expected no target, because the anchored "
            "expression is changed; leave it out, or anchor at a statement",
        ),
        (
            "model: offset\n          unit: m\n          params: {by_m: error}",
            "model: bit_flip\n          params: {bit: 64}",
            "16: 64 for 'bit'; expected at least 0 and at most 63; correct the value",
        ),
        (
            "params: {by_m: error}",
            "params: {by_m: null}",
            "17: nothing for 'by_m'; expected a number, or 'error', the draw; correct the value",
        ),
        (
            "params: {by_m: error}",
            "params: {target: null, by_m: error}",
            "17: nothing for 'target'; expected a name as in the source; correct the value",
        ),
        (
            "model: offset\n          unit: m\n          params: {by_m: error}",
            "model: stuck\n          unit: m\n          params: {value_m: far}",
            "17: 'far' for 'value_m'; expected a number, or 'error', the draw; correct the value",
        ),
        (
            "model: offset\n          unit: m\n          params: {by_m: error}",
            "model: stuck\n          unit: m\n          params: {value_m: true}",
            "17: true for 'value_m'; expected a number; correct the value",
        ),
        (
            "model: offset\n          unit: m\n          params: {by_m: error}",
            "model: stuck\n          unit: m\n          params: {value: 3}",
            "17: 'value' (no unit); expected `value_m`",
        ),
        (
            "model: offset\n          unit: m\n          params: {by_m: error}",
            "model: stuck\n          unit: '1'\n          params: {value: -errror}",
            "17: '-errror' for 'value'; expected 'error', the draw, or a text that is less similar",
        ),
        (
            "model: offset\n          unit: m\n          params: {by_m: error}",
            "model: delay\n          params: {delay_ms: -100}",
            "16: -100 for 'delay_ms'; expected at least 0 s; correct the value",
        ),
        (
            "          unit: m\n",
            "",
            "14: model offset without `unit`; expected the changed variable's unit, one of {KNOWN}, "
            "or '1'; add `unit: m` (the variable's unit in the source) next to "
            "`model`",
        ),
        (
            "          unit: m\n",
            "          unit: feet\n",
            "16: unit 'feet'; expected one of {KNOWN}, its symbol (`m/s`), or '1' "
            "for a plain number; name the unit that the variable has in the source",
        ),
        (
            "by_kph: -error",
            "by_kph: -errror",
            "42: '-errror' for 'by_kph'; expected a number, or 'error', the draw; correct the value",
        ),
        (
            "error_kph:",
            "error_deg:",
            "42: '-error' for 'by_kph'; expected the same dimension: deg is not a unit of speed; "
            "correct the value",
        ),
        (
            "model: offset",
            "model: ofset",
            "unknown fault model 'ofset'; expected one of bit_flip, byte_corruption, clamp",
        ),
        ("aim: H1", "aim: H9", "7: aim 'H9'; expected one of H1, as in toy.yaml; correct it"),
        (
            "changes: [alone]",
            "changes: [no_lead]",
            "22: change 'no_lead'; expected one of alone, as in toy.yaml; correct it",
        ),
        (
            "file: toycar/sensor.py",
            "file: ../toycar/sensor.py",
            "14: path '../toycar/sensor.py' leads out of the target; expected a path relative to the "
            "target's root, without `..`; name a file inside the target",
        ),
        ("file: toycar/sensor.py", "file: /etc/passwd", "14: path '/etc/passwd' leads out"),
        ("file: toycar/sensor.py", "file: toycar/none.py", "14: no Python file 'toycar/none.py'"),
        ("file: toycar/sensor.py", "file: ./toycar/sensor.py", "no Python file './toycar/sensor.py'"),
        ("file: toycar/sensor.py", "file: toycar/judge.py", "into file 'toycar/judge.py'"),
        ("after_assign: gap", "after_assign: 'gap = 1'", "14: 'gap = 1'; expected a name as in the source"),
        ("after_assign: gap", "after_assign: _fi", "14: '_fi'; expected a name as in the source"),
        ("after_assign: gap", "afterassign: gap", "14: unknown key 'afterassign'; expected one of file"),
        ("after_assign: gap", "after_assign: gap, nth: 0", "14: 0 for 'nth'; expected greater than"),
        (
            "after_assign: gap",
            "after_assign: gap, before_call: self.send",
            "14: 2 anchors (after_assign, before_call); expected exactly one of after_assign",
        ),
        ("last: [30, 39]", "last: [31, 40]", "for 'integers_from'; expected a last range"),
        ("last: [30, 39]", "last: [.inf, .inf]", "inf for '"),
        ("last: [30, 39]", "last: [30, .nan]", "nan for '"),
        ("first: [10, 19]", "first: [-.inf, 19]", "-inf for '"),
        ("last: [30, 39]", "last: [1.0e+300, 1.0e+300]", "1e+300 for '"),
        ("first: [10, 19], step: 10", "first: [10, 19], step: 5.0e-324", "at most 1000 ranges"),
        ("first: [10, 19], step: 10", "first: [10, 19], step: .inf", "inf for 'step'"),
        (
            "as_coded:",
            "as_built:",
            "43: unknown key 'as_built'; expected one of aim, about, changes, hold, phrase, draw, "
            "as_described, as_coded, injections",
        ),
        ("integers_from", "integers_form", "11: unknown key 'integers_form'; expected one of integers_"),
        ("first: [10, 19], step: 10", "first: [10.5, 19.5], step: 0.5", "a range with fractions"),
        ("error_m:\n", "error_m:\n        decimals: 1\n", "11: decimals: 1; expected `decimals` only with"),
        ("error_m:\n", "error_m:\n        values: [1]\n", "10: 2 ways to draw"),
        (
            "error_m:\n",
            "other_m: {values: [1]}\n      error_m:\n",
            "11: 2 draws, one of them by chance; expected",
        ),
        ("module: sensor", "module: Sensor", "2: 'Sensor'; expected lowercase letters"),
        ("hold: to_end", "hold: forever", "21: 'forever' for 'hold'; expected one of 'while' or 'to_"),
        (
            "written_in: kph",
            "written_in: knots",
            "51: 'knots' for 'written_in'; expected one of {KNOWN}",
        ),
        (
            "read_as: mps",
            "readas: mps",
            "expected a number, a name, or {draw: ..., written_in: ..., read_as: ...}",
        ),
    ],
)
def test_a_mistake_is_reported_with_a_remedy(toy: Workspace, old: str, new: str, message: str) -> None:
    assert message.replace("{KNOWN}", UNIT_SUFFIXES_TEXT) in edited(toy, old, new)
