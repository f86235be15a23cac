"""The reference page of the spec format."""

from pathlib import Path

from mutator import spec_reference
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[3]


def test_the_page_is_up_to_date() -> None:
    """docs/reference/fault-spec.md says what the schema and the templates say now."""
    page = (CLONE / spec_reference.PAGE).read_text(encoding="utf-8")
    assert page == spec_reference.page(Workspace.find(CLONE)), "run: python -m mutator.spec_reference"


def test_nothing_is_told_that_the_schema_does_not_have() -> None:
    """Every key that the page explains exists in the schema."""
    schema = spec_reference.json_schema()
    definitions = {"_SpecModel": schema} | schema["$defs"]
    keys = {f"{name}.{key}" for name, d in definitions.items() for key in d["properties"]}
    assert set(spec_reference.ABOUT) == keys
