"""The readings that a library declares."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.faults.library_readings import DEFAULT_READINGS, READINGS_FILE, load_readings
from mutator.faults.spec_expansion import expand_spec
from mutator.workspace import Workspace

TEXT = """\
schema: readings/1
readings:
  {first}:
    about: The first.
  {second}:
    about: The second.
"""


def declare(workspace: Workspace, first: str, second: str) -> None:
    (workspace.library / READINGS_FILE).write_text(TEXT.format(first=first, second=second))


def test_the_first_reading_is_the_default(toy: Workspace) -> None:
    declare(toy, "printed", "measured")
    readings = load_readings(toy.library)
    assert (readings.names, readings.default_name) == (("printed", "measured"), "printed")
    assert readings.descriptions == ("The first.", "The second.")


def test_a_library_without_the_file_has_one_reading(toy: Workspace) -> None:
    spec = next(iter(toy.spec_files()))
    spec.write_text(spec.read_text().partition("  both:")[0])

    def ids() -> list[str]:
        models, manifest = toy.fault_models(), toy.manifest("toy")
        return [f.id for f in expand_spec(toy.spec(spec), 3, models=models, manifest=manifest)]

    before = ids()
    (toy.library / READINGS_FILE).unlink()
    assert toy.readings() == DEFAULT_READINGS
    assert ids() == before


def test_specs_use_the_declared_readings_as_keys(toy: Workspace) -> None:
    for path in toy.spec_files():
        text = path.read_text().replace("as_described:", "printed:").replace("as_coded:", "measured:")
        path.write_text(text)
    with pytest.raises(MutatorError, match=r"unknown key 'printed'; .* as_described, as_coded"):
        toy.specs()
    declare(toy, "printed", "measured")
    [spec] = toy.specs()
    models, manifest = toy.fault_models(), toy.manifest("toy")
    for reading, expected in ((None, "printed"), ("measured", "measured")):
        found = expand_spec(spec, 3, reading, models=models, manifest=manifest)
        assert {fault.reading for fault in found} == {expected}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("schema: readings/1\nreadings: {}\n", "readings.yaml:2: {} for 'readings'"),
        ("schema: readings/1\nreadings: {As-Coded: {about: x}}\n", "readings.yaml:2: 'As-Coded'"),
        ("schema: readings/1\nreadings: {a: {abuot: x}}\n", "unknown key 'abuot'"),
    ],
)
def test_a_mistake_is_reported_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / READINGS_FILE).write_text(text)
    with pytest.raises(MutatorError) as error:
        load_readings(tmp_path)
    assert said in str(error.value)
