"""A target whose cart rolls towards a wall, backs off, hits it, and goes through it."""

from pathlib import Path

import numpy as np

from mutator.targets.manifest import TargetManifest
from mutator.targets.manifest_files import load_manifest

T = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
GAP = np.array([3.0, 1.0, 2.0, 0.0, -1.0, 4.0])
SPEED = np.array([1.0, 2.0, -1.0, 2.0, 1.0, 0.0])
HEAD = """\
schema: target/2
name: cart
root: .
package: cart
files: ["cart/*.py"]
step_s: 1
entry: {module: cart.go, args: []}
trace: {file: trace.npz, time: time}
channels:
  force: {unit: N, role: actuator}
  gap: {unit: m, role: truth}
  speed: {unit: m/s, role: truth}
observation:
  at: {file: cart/go.py, function: step, after_assign: now}
  values:
    gap: {is: now.gap, unit: m, about: to the wall}
    speed: {is: now.speed, unit: m/s, about: towards it}
  derived:
    left: {is: gap / speed if speed > 0 else inf, unit: s, about: until contact}
"""


def write_manifest(folder: Path, rest: str, **replaced: str) -> TargetManifest:
    """Write a manifest of the cart that ends with `rest`. Keys of its head are replaced by other texts."""
    text = HEAD
    for old, new in replaced.items():
        text = text.replace(f"{old}:", f"{new}")
    (folder / "cart.yaml").write_text(text + rest)
    return load_manifest(folder / "cart.yaml")
