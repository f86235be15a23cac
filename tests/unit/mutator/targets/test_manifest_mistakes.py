"""The errors for mistyped manifests."""

import re
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.targets.manifest_files import load_manifest

WHOLE = """\
schema: target/2
name: cart
root: tree
package: cart
overlay: glue
forbid: ["cart/world.py"]
env: {CART_MODE: quiet}
requires: ["numpy>=1"]
step_s: 0.1
entry:
  module: drive
  args: [--scenario, "{scenario}", "--out={out}"]
  stepwise: open_run
  changes: {alone: [--alone]}
trace: {file: trace.npz, time: t}
record: record.json
channels:
  force: {unit: N, role: actuator, tolerance: 0.5}
  gap: {unit: m, role: truth}
observation:
  at: {file: drive.py, function: step, after_assign: now}
  time: now
  values:
    gap: {is: cart.gap, unit: m, about: to the wall}
    seen: {is: cart.seen, unit: m, about: an observed value}
  derived:
    closing: {is: 0 - gap, unit: m, about: the other way}
hazards:
  HIT: {about: it hits the wall, when: gap <= 0, for_s: 0.2, margin: gap, unit: m, terminal: true}
  LATE: {}
metrics:
  least: {min: gap, where: gap > 0, unit: m, worse: lower, about: least gap}
scene:
  actors: {cart: {length_m: 2, x: gap}}
  lines: {wall: {y: "0"}}
  follow: cart
alerts: [beep]
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "tree" / "cart").mkdir(parents=True)
    (tmp_path / "glue").mkdir()
    return tmp_path / "cart.yaml"


def test_the_manifest_is_valid_without_the_mistakes(path: Path) -> None:
    path.write_text(WHOLE)
    assert load_manifest(path).hazard_names == ("HIT", "LATE")


@pytest.mark.parametrize(
    ("right", "wrong", "got", "known"),
    [
        ("schema: target/2", "schema: target/9", "target/9", "target/2"),
        ("step_s: 0.1", "step_s: 0.1\nstep_s: 0.2", "duplicate key", "once"),
        ("step_s: 0.1", "steps: 0.1", "unknown key 'steps'", "step_s"),
        ("step_s: 0.1", "step_s: fast", "'fast'", "number"),
        ("root: tree", "root: installed:no_such_package", "no_such_package", "import"),
        ("package: cart", "package: ca-rt", "'ca-rt'", "name"),
        ("overlay: glue", "overlay: glu", "glu", "folder"),
        ("CART_MODE", "PYTHONPATH", "PYTHONPATH", "harness"),
        ("numpy>=1", "numpy >", "numpy >", "gymnasium>=1.0"),
        ("module: drive", "module: drive.py x", "'drive.py x'", "module"),
        ("--out={out}", "--out={outt}", "{outt}", "{out}"),
        ("stepwise: open_run", "stepwise: open run", "'open run'", "function"),
        ("file: trace.npz", "file: trace.mat", "'trace.mat'", ".npz"),
        ("record: record.json", "record: ../record.json", "'../record.json'", "bare file name"),
        ("role: actuator, tolerance: 0.5", "role: output", "'output'", "actuator"),
        ("role: actuator, tolerance: 0.5", "role: truth", "no channel", "what the controller commands"),
        ("gap: {unit: m, role: truth}", "gap: {unit: m, tolerance: -1}", "-1", "greater than or equal to 0"),
        ("file: drive.py", "file: ../drive.py", "'../drive.py'", "in"),
        ("is: cart.gap", "is: cart.gap()", "'cart.gap()'", "attributes"),
        ("is: 0 - gap", "is: 0 - gab", "'gab'", "gap"),
        ("when: gap <= 0", "when: gap = 0", "gap = 0", "comparisons"),
        ("when: gap <= 0", "when: speed <= 0", "'speed'", "t, force, gap, closing"),
        ("record: record.json\n", "", "without `when`", "record"),
        ("when: gap <= 0", "wen: gap <= 0", "unknown key 'wen'", "when"),
        ("for_s: 0.2", "for_s: long", "'long' for 'for_s'", "a number"),
        ("alone: [--alone]", "alone: {arg: [--alone], same_in: [A, B]}", "unknown key 'arg'", "args"),
        ("margin: gap", "margin: gap > 0", "gap > 0", "gap"),
        ("min: gap", "min: gap, max: gap", "min and max", "one of"),
        ("min: gap", "ends_before_s: 1, at_end: gap", "`at_end` and `ends_before_s`", "one of them"),
        ("min: gap", "ends_before_s: -1, min: gap", "-1", "greater than or equal to 0"),
        ("worse: lower", "worse: smaller", "'smaller'", "lower"),
        ("  gap: {unit: m, role", "  rate: {unit: m, role", "'rate'", "from: rate"),
        ("  LATE: {}", "  LATE: {for_s: 1}", "judged by the record", "when"),
        ("is: cart.gap", "is: 'abs(1, 2)'", "abs(1, 2)", "attributes"),
        ("when: gap <= 0", "when: golden.gap <= 0", "unknown name 'golden.gap'", "t, force, gap, closing"),
        ("min: gap", "min: golden.gab", "unknown name 'golden.gab'", "golden.gap"),
        ("min: gap", "min: gold.gap", "'gold.gap'", "golden.gap"),
        ("min: gap", "min: golden.gap.gap", "'golden.gap.gap'", "golden.gap"),
        ("min: gap", "min: golden.seen", "observed but not recorded", "role: truth"),
        ("when: gap <= 0", "when: seen <= 0", "observed but not recorded", "role: truth"),
        ("  least:", "  t_hit least:", "'t_hit least'", "letters"),
        ("follow: cart", "follow: car", "'car'", "cart"),
        ('{y: "0"}', "{points_m: [[1, 2], [3]]}", "[3.0]", "[x, y]"),
        ("alerts: [beep]", "alerts: [beep, Beep]", "'Beep'", "unique name"),
    ],
)
def test_a_mistake_is_reported_with_a_remedy(
    path: Path, right: str, wrong: str, got: str, known: str
) -> None:
    assert right in WHOLE
    path.write_text(WHOLE.replace(right, wrong, 1))
    with pytest.raises(MutatorError) as caught:
        load_manifest(path)
    error = caught.value
    assert re.match(rf"{re.escape(str(path))}:\d+$", f"{error.where}:{error.line}")
    assert got in error.got
    assert known in f"{error.expected} {error.remedy}"
    assert error.expected
    assert error.remedy
