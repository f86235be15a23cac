"""A small closed loop, with its library: the controller under test pushes a mass to y = 0."""

from pathlib import Path

from mutator.workspace import Workspace

_DRIVE = """\
from law import Control

from mutator.glue import Run


class Drive(Run):
    def __init__(self, scenario, seed):
        super().__init__(step_s=0.05, duration_s=scenario["duration_s"])
        self.y, self.v = 1.0, 0.0
        self.controller = Control()

    def step(self):
        y = self.y
        command = min(max(float(self.controller.update(y, self.step_s)), -5.0), 5.0)
        self.v += command * self.step_s
        self.y += self.v * self.step_s
        self.record(y=y, command=command)


if __name__ == "__main__":
    Drive.main()
"""
_MANIFEST = """\
schema: target/2
name: t
root: ../../tree
packages: {packages}
overlay: ../overlays/o
entry: {{module: drive, stepwise: Drive.open}}
step_s: 0.05
observation:
  at: {{file: drive.py, function: Drive.step, after_assign: y}}
  time: self.t
  values:
    y: {{is: y, unit: m, about: place}}
channels:
  y: {{unit: m, role: truth}}
  command: {{unit: m/s^2, role: actuator}}
hazards:
  OFF: {{about: too far from 0, when: abs(y) > 3, unit: m}}
"""
_SPEC = """\
schema: fault_spec/1
module: c
fault_type: f
about: A fault.
variants:
"""
_VARIANT = """\
  {name}:
    aim: OFF
    about: flip.
    as_described:
      injections:
        - at: {at}
          model: sign_flip
"""


def small_loop(folder: Path, files: dict[str, str], *, manifest: str = "", **places: str) -> Workspace:
    """Write a loop with these files of the controller (`law.py` with `Control`), and faults named c/f/<name>.

    `places` has the `at` of each fault, in YAML; `manifest` is more text for the manifest.
    """
    for path, text in files.items():
        (folder / "tree" / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / "tree" / path).write_text(text)
    packages = sorted({path.partition("/")[0] for path in files})
    variants = [_VARIANT.format(name=name, at=at) for name, at in places.items()]
    texts = {
        "overlays/o/drive.py": _DRIVE,
        "targets/t.yaml": _MANIFEST.format(packages=f"[{', '.join(packages)}]") + manifest,
        "scenarios/s.yaml": "duration_s: 1.0\n",
        "faults/c/f.yaml": _SPEC + "".join(variants),
    }
    for path, text in texts.items():
        (folder / "fault_library" / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / "fault_library" / path).write_text(text)
    return Workspace.find(library=folder / "fault_library")
