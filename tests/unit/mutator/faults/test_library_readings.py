"""The readings that a library declares."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.faults.library_readings import NO_READINGS, READINGS_FILE, load_readings
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault
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
    assert toy.readings() == NO_READINGS
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


def expanded(workspace: Workspace) -> list[Fault]:
    return [fault for fault in workspace.faults() if fault.spec.endswith("/silent")]


def put_injections_directly(workspace: Workspace) -> None:
    """Leave the reading's key out of the only variant that remains, `silent`."""
    [path] = workspace.spec_files()
    head, _, rest = path.read_text().partition("variants:\n")
    silent = rest[rest.index("  silent:") : rest.index("  both:")]
    before, _, injections = silent.partition("    as_described:\n")
    direct = "".join(line.removeprefix("  ") for line in injections.splitlines(keepends=True))
    path.write_text(f"{head}variants:\n{before}{direct}")


def test_a_library_without_readings_has_injections_directly_under_its_variants(toy: Workspace) -> None:
    """Both forms are the same fault: its id must not change when the needless key goes."""
    ids = [fault.id for fault in expanded(toy)]
    (toy.library / READINGS_FILE).unlink()
    put_injections_directly(toy)
    faults = expanded(toy)
    assert [fault.id for fault in faults] == ids
    assert {fault.reading for fault in faults} == {""}


def test_a_library_with_one_reading_does_not_need_its_name(toy: Workspace) -> None:
    """The faults are in that reading."""
    put_injections_directly(toy)
    (toy.library / READINGS_FILE).write_text("schema: readings/1\nreadings: {only: {about: The only one.}}\n")
    assert {fault.reading for fault in expanded(toy)} == {"only"}


def test_injections_outside_a_reading_are_refused_if_there_are_several(toy: Workspace) -> None:
    """It would not be clear which reading they belong to."""
    [path] = toy.spec_files()
    path.write_text(
        path.read_text().replace("    as_described:\n", "    injections: []\n    as_described:\n", 1)
    )
    with pytest.raises(
        MutatorError, match=r"\d: injections outside a reading; expected the key `as_described`"
    ):
        toy.specs()


def test_a_variant_without_injections_or_with_two_lists_is_refused(toy: Workspace) -> None:
    """Without declared readings, the error must not ask for one."""
    (toy.library / READINGS_FILE).unlink()
    put_injections_directly(toy)
    [path] = toy.spec_files()
    text = path.read_text()
    path.write_text(text[: text.index("    injections:")])
    with pytest.raises(MutatorError, match=r"no injections; expected the key `injections`"):
        toy.specs()
    path.write_text(f"{text}    as_described: {{injections: []}}\n")
    with pytest.raises(MutatorError, match=r"injections twice"):
        toy.specs()


def test_a_reading_is_unknown_where_none_is_declared(toy: Workspace) -> None:
    """The error must not list a reading that the library does not know."""
    (toy.library / READINGS_FILE).unlink()
    with pytest.raises(MutatorError) as caught:
        toy.readings().check_name("as_coded")
    assert caught.value.expected == "none: this library declares none"


def test_an_aim_is_not_needed(toy: Workspace) -> None:
    """A library without a hazard analysis has nothing to aim at."""
    [path] = toy.spec_files()
    path.write_text("".join(x for x in path.read_text().splitlines(keepends=True) if "    aim:" not in x))
    assert {fault.aim for fault in expanded(toy)} == {""}
