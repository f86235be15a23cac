"""The generated reference: its pages and JSON Schemas match the program."""

import json
import math
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from typer.main import get_command

from mutator._common import shipped_files
from mutator.cli.app import SUBCOMMAND_GROUPS, app
from mutator.config import yaml_files
from mutator.errors import MutatorError
from mutator.faults.fault_specs import build_spec_model
from mutator.reference.generated_files import (
    PAGES_FOLDER,
    RENDER_BY_PAGE,
    SCHEMAS_FOLDER,
    STUB_PATH,
    render_files,
    write_files,
)
from mutator.reference.json_schemas import YamlFormat, schema_by_model, yaml_formats
from mutator.reference.yaml_key_tables import order_models
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[4]
FORMATS = yaml_formats(Workspace.find(CLONE).readings())
CHAFF = CLONE / "fault_library" / "faults" / "radar" / "chaff.yaml"


def validator(kind: str) -> jsonschema.Draft7Validator:
    return jsonschema.Draft7Validator(json.loads((CLONE / SCHEMAS_FOLDER / f"{kind}.json").read_text()))


def described(kind: YamlFormat) -> dict[str, dict[str, Any]]:
    return {name: part for name, part in schema_by_model(kind.model).items() if "properties" in part}


@pytest.mark.parametrize(
    "path",
    [
        *(PAGES_FOLDER / page for page in RENDER_BY_PAGE),
        *(SCHEMAS_FOLDER / f"{f.name}.json" for f in FORMATS),
        STUB_PATH,
    ],
)
def test_generated_files_are_up_to_date(path: Path) -> None:
    generated = _generated()[path]
    assert (CLONE / path).read_text(encoding="utf-8") == generated, "run: python -m mutator.reference"


_FILES: dict[Path, str] = {}


def _generated() -> dict[Path, str]:
    if not _FILES:
        _FILES.update(render_files(Workspace.find(CLONE)))
    return _FILES


def test_no_generated_file_lacks_a_source() -> None:
    """The target generates `scenario.json`."""
    pages = [
        path
        for path in (CLONE / "docs").rglob("*.md")
        if "python -m mutator.reference`; do" in path.read_text()
    ]
    found = {path.relative_to(CLONE) for path in (*pages, *(CLONE / SCHEMAS_FOLDER).glob("*"))}
    assert found - {SCHEMAS_FOLDER / "scenario.json"} == {*_generated()} - {STUB_PATH}


@pytest.mark.parametrize("kind", FORMATS, ids=lambda kind: kind.name)
def test_every_model_and_key_is_described(kind: YamlFormat) -> None:
    parts = described(kind)
    assert parts
    for name, part in parts.items():
        assert not part["title"].endswith("Model"), f"{name}: give the class a title"
        for key, value in part["properties"].items():
            assert value["description"].endswith("."), f"{name}.{key}: expected a sentence"


def test_models_are_in_reading_order() -> None:
    names = order_models(schema_by_model(build_spec_model(Workspace.find(CLONE).readings())))
    assert names == [
        "Spec", "Variant", "SignedPhrase", "Draw", "Sweep", "VariantReading", "Injection", "Location",
        "Message",
    ]  # fmt: skip


def test_every_command_is_in_a_group() -> None:
    command: Any = get_command(app)
    assert sorted(name for _, names in SUBCOMMAND_GROUPS for name in names) == sorted(command.commands)


@pytest.mark.parametrize("kind", FORMATS, ids=lambda kind: kind.name)
def test_library_files_follow_their_schema(kind: YamlFormat) -> None:
    files = sorted(CLONE.glob(kind.files_glob))
    assert files
    check = validator(kind.name)
    for file in files:
        data = yaml_files.load_yaml(file).data
        assert data["schema"] == kind.schema, file
        assert not [f"{file}: {error.message}" for error in check.iter_errors(data)]


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("schema",), "fault_spec/2"),
        (("fault_typ",), "chaff"),
        (("variants", "distance", "hold"), "forever"),
        (("variants", "distance", "draw", "distance_m", "integers_from", "step"), 0),
        (("variants", "distance", "as_described", "injections", 0, "at", "nth"), 0),
        (("variants", "distance", "as_described", "injections", 0, "unit"), "yard"),
        (("variants", "distance", "as_described", "injections", 0, "params"), {"bye_m": 1}),
        (("variants", "distance", "as_described", "injections", 0, "params"), {"by": 1, "by_m": [1]}),
    ],
)
def test_a_schema_rejects_invalid_keys_and_values(keys: tuple[str | int, ...], value: Any) -> None:
    data = yaml_files.load_yaml(CHAFF).data
    check = validator("fault_spec")
    assert check.is_valid(data)
    inner = data
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    assert not check.is_valid(data)


def test_a_schema_accepts_a_users_fault_model() -> None:
    data = yaml_files.load_yaml(CHAFF).data
    injection = data["variants"]["distance"]["as_described"]["injections"][0]
    injection |= {"model": "mine", "params": {"whatever_m": math.inf}}
    assert validator("fault_spec").is_valid(data)


def test_pages_are_written_only_in_a_clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installed wheel has no clone to write to."""
    monkeypatch.setattr(shipped_files, "SHIPPED_ARCHIVE_PATH", tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    library = tmp_path / "mutator" / "shipped" / "0" / "fault_library"
    with pytest.raises(MutatorError, match="ships with mutator"):
        next(write_files(Workspace(library=library, templates=library.with_name("templates"))))
    assert list(tmp_path.iterdir()) == []
