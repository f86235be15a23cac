"""The names that injected statements import."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.faults.import_checks import check_import_defined
from mutator.faults.spec_expansion import expand_spec
from mutator.workspace import Workspace

SPEC = """schema: fault_spec/1
module: sensor
fault_type: weather
about: Something is in the way.
variants:
  level:
    aim: H1
    about: More of it with each level.
    draw:
      level: {values: [1, 2]}
    as_described:
      injections:
        - at: {file: toycar/sensor.py, function: Sensor.measure, after_assign: gap}
          model: image_effect
          unit: '1'
          params: {effect: toycar.sensor.NAME, amount: level, camera: self, scene: truth}
"""


def answer(toy: Workspace, name: str) -> str:
    """Return the error for a spec whose effect has this name, or an empty text if the spec expands."""
    path = toy.library / "faults" / "sensor" / "weather.yaml"
    path.write_text(SPEC.replace("toycar.sensor.NAME", name))
    try:
        expand_spec(toy.spec(path), 1, models=toy.fault_models(), manifest=toy.manifest("toy"))
    except MutatorError as error:
        return str(error).replace(str(path), "weather.yaml")
    return ""


def test_a_spec_can_import_a_class_of_the_target(toy: Workspace) -> None:
    assert answer(toy, "toycar.sensor.Sensor") == ""


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (
            "toycar.sensor.Senser",
            "'Senser' is not defined in toycar/sensor.py; expected one of Sensor; correct the name; "
            "did you mean 'Sensor'?",
        ),
        ("toycar.weather.Rain", "no module 'toycar.weather' in target toy; expected a module of the target"),
        ("os.system", "no module 'os' in target toy"),
        ("Sensor", "no module '' in target toy"),
        ("toycar.sensor.Sensor()", "'Sensor()' is not defined in toycar/sensor.py"),
    ],
)
def test_an_undefined_name_is_reported_at_its_line(toy: Workspace, name: str, said: str) -> None:
    assert answer(toy, name).startswith(f"weather.yaml:16: {said}")


@pytest.mark.parametrize(
    "line", ["from toycar.road import Rain", "import x as Rain", "Rain = Snow", "def Rain(): 0"]
)
def test_a_reexported_name_is_defined(toy: Workspace, line: str) -> None:
    (Path(toy.manifest("toy").root) / "toycar" / "sky.py").write_text(f"{line}\n")
    check_import_defined(toy.manifest("toy"), "toycar.sky.Rain")


def test_an_invalid_target_module_is_an_error_at_its_line(toy: Workspace) -> None:
    path = Path(toy.manifest("toy").root) / "toycar" / "sky.py"
    path.write_text("class Rain:\n    x = = 1\n")
    with pytest.raises(MutatorError, match="not valid Python: invalid syntax") as caught:
        check_import_defined(toy.manifest("toy"), "toycar.sky.Rain")
    assert (caught.value.where, caught.value.line) == (str(path), 2)
