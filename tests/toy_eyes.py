"""A camera for the toy car."""

from mutator.workspace import Workspace

_LENS = """\
import numpy as np


class Light:
    def __init__(self, amount, seed, camera):
        self.amount = amount

    def apply(self, picture, scene):
        return np.clip(picture + self.amount, 0, 255).astype(np.uint8)
"""
_LIGHT = """\
schema: fault_spec/1
module: sensor
fault_type: light
about: The picture is too light.
variants:
  level:
    aim: H3
    about: By so many grey levels.
    draw:
      level: {{values: {values}}}
    as_described:
      injections:
        - at: {{file: toycar/sensing.py, function: Sensor.sense, after_assign: {place}}}
          model: image_effect
          unit: '1'
          params: {{effect: toycar.lens.Light, target: {target}, amount: level, camera: self, scene: world}}
"""


def give_eyes(
    toycar: Workspace,
    values: str = "[10, 20, 40, 80, 160]",
    picture: str = "np.full((12, 16), 90, np.uint8)",
    target: str = "picture",
    place: str = "picture",
) -> None:
    """Give the car of a copied toy a camera frame, and add the image effect `sensor/light` to its library."""
    tree = toycar.library.parent / "tree/toycar"
    text = (tree / "sensing.py").read_text()
    offset = "        offset = world.offset\n"
    seen = f"        picture = {picture}\n        self.picture = picture\n{offset}"
    text = text.replace("class Sensor", "import numpy as np\n\n\nclass Sensor").replace(offset, seen)
    (tree / "sensing.py").write_text(text)
    (tree / "lens.py").write_text(_LENS)
    spec = _LIGHT.format(values=values, target=target, place=place)
    (toycar.library / "faults/sensor/light.yaml").write_text(spec)
