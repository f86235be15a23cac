"""Strict YAML: every mistake is reported with file, line, finding, expectation and remedy."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from pydantic import Field

from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata
from mutator.config import yaml_files
from mutator.errors import MutatorError


class Wheel(yaml_files.StrictModel):
    radius: float
    spokes: int = 5


class Car(yaml_files.StrictModel):
    name: str
    wheels: dict[str, Wheel] = Field(default_factory=dict)
    spare: Wheel | None = None
    tags: list[str] = Field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelRecord:
    __pydantic_config__ = pydantic_mapping_config("A wheel")

    size: float = field(metadata=yaml_metadata("The radius.", alias="radius"))
    spokes: int = 5
    nuts: tuple[str, ...] = field(default=(), metadata=yaml_metadata(strict=False))


class CarOfRecords(yaml_files.StrictModel):
    name: str
    wheels: dict[str, yaml_files.YamlRecord[WheelRecord]] = Field(default_factory=dict)
    spare: yaml_files.YamlRecord[WheelRecord] | None = None
    tags: list[str] = Field(default_factory=list)


def read(tmp_path: Path, text: str | bytes, model: type[Any] = Car) -> Any:
    path = tmp_path / "car.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return yaml_files.load_yaml_model(path, model, "car/2")[0]


def test_a_dataclass_in_a_file_is_read_as_it_is(tmp_path: Path) -> None:
    text = "schema: car/2\nname: on\nwheels: {left: {radius: 3, nuts: [a, b]}}\n"
    car = read(tmp_path, text, CarOfRecords)
    assert car.wheels == {"left": WheelRecord(size=3.0, nuts=("a", "b"))}


def test_a_valid_file_is_read(tmp_path: Path) -> None:
    """Words that YAML 1.1 reads as booleans, numbers or times remain text."""
    car = read(
        tmp_path, "schema: car/2\nname: on\nwheels: {left: {radius: 3}}\ntags: ['1', 1:30, no, 1_0, 0x1]\n"
    )
    assert car.name == "on"
    assert car.wheels["left"].radius == 3.0
    assert car.tags == ["1", "1:30", "no", "1_0", "0x1"]


@pytest.mark.parametrize(
    ("text", "line", "pieces"),
    [
        (
            "schema: car/2\nname: x\nname: y\n",
            3,
            ["duplicate key 'name'", "line 2", "remove one"],
        ),
        (
            "schema: car/2\nname: x\nnmae: y\n",
            3,
            ["unknown key 'nmae'", "one of name, wheels", "mean 'name'"],
        ),
        (
            "schema: car/2\nname: x\nwheels:\n  left:\n    radius: 1\n    radios: 2\n",
            6,
            ["unknown key 'radios'", "one of radius, spokes", "mean 'radius'"],
        ),
        ("schema: car/2\nname: x\nspare: {radius: 1, a: 2}\n", 3, ["unknown key 'a'", "radius, spokes"]),
        ("schema: car/2\nname: 3\n", 2, ["3 for 'name'", "expected text", "quotes"]),
        ("schema: car/2\nname: true\n", 2, ["true for 'name'", "expected text"]),
        (
            "schema: car/2\nname: x\nspare:\n  radius: 3 m\n",
            4,
            ["'3 m' for 'radius'", "expected a number", "without quotes or unit"],
        ),
        ("schema: car/2\nname: x\nspare:\n  radius:\n", 4, ["nothing for 'radius'", "a number"]),
        (
            "schema: car/2\nname: x\nspare: {radius: 1, spokes: 1.5}\n",
            3,
            ["1.5 for 'spokes'", "whole number"],
        ),
        ("schema: car/2\nname: x\nspare: [1]\n", 3, ["[1] for 'spare'", "expected a mapping"]),
        ("schema: car/2\nname: x\ntags: a\n", 3, ["'a' for 'tags'", "expected a list"]),
        ("schema: car/2\nspare: {radius: 1}\n", 1, ["key 'name' is missing", "add `name: ...`"]),
        ("schema: car/3\nname: x\n", 1, ["'car/3'", "expected car/2", "newer version"]),
        ("schema: car/1\nname: x\n", 1, ["'car/1'", "expected car/2", "start the file with"]),
        ("schema: bus/2\nname: x\n", 1, ["'bus/2'", "expected car/2", "start the file with"]),
        ("name: x\n", 1, ["no schema", "`schema: car/2`"]),
        ("schema: car/2\nname: &a x\nspare: *a\n", 2, ["an anchor or alias", "write the value out"]),
        ("schema: car/2\nname: !!python/object:os.system x\n", 2, ["a tag", "plain values"]),
        ("schema: car/2\nname: x\n<<: {a: 1}\n", 3, ["unknown key '<<'"]),
        ("schema: car/2\n1: x\n", 2, ["key '1'", "expected text"]),
        ("schema: car/2\nname: x\n\ttags: []\n", 3, ["not valid YAML", "tab"]),
        ("schema: car/2\nname: 'x\n", 3, ["not valid YAML"]),
        ("schema: car/2\nname: x\n---\nname: y\n", 3, ["a second document", "remove the `---`"]),
    ],
)
@pytest.mark.parametrize("model", [Car, CarOfRecords])
def test_a_mistake_is_reported_at_its_line(
    tmp_path: Path, model: type[Any], text: str, line: int, pieces: list[str]
) -> None:
    with pytest.raises(MutatorError) as caught:
        read(tmp_path, text, model)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'car.yaml'}:{line}: ")
    for piece in pieces:
        assert piece in message


def test_a_list_in_a_dataclass_is_called_a_list(tmp_path: Path) -> None:
    text = "schema: car/2\nname: on\nspare:\n  radius: 3\n  nuts: a\n"
    with pytest.raises(MutatorError, match=r"car\.yaml:5: 'a' for 'nuts'; expected a list"):
        read(tmp_path, text, CarOfRecords)


@pytest.mark.parametrize("text", ["", "- a\n", "word\n"])
def test_a_file_that_is_not_a_mapping_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(MutatorError, match="expected a mapping of keys to values"):
        read(tmp_path, text)


def test_invalid_utf_8_is_refused_with_its_offset(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="not UTF-8 \\(byte 0xff at offset 6\\)"):
        read(tmp_path, b"name: \xff\n")


def test_deep_nesting_and_huge_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MutatorError):
        read(tmp_path, "[" * 20_000)
    with pytest.raises(MutatorError, match="at most 1,000,000 bytes"):
        read(tmp_path, "#" * 1_000_001)


def test_a_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="cannot be read"):
        yaml_files.load_yaml(tmp_path / "none.yaml")


def test_further_mistakes_are_counted(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="1 more mistake after this one"):
        read(tmp_path, "schema: car/2\nname: 1\ntags: 2\n")
