"""Dataclasses that are written in YAML. A process that reads no YAML does not load pydantic for them."""

from typing import Any


def pydantic_mapping_config(title: str) -> dict[str, Any]:
    """Return the `__pydantic_config__` of a dataclass that is written as a mapping, as strict as its file.

    `title` is its heading on reference pages.
    """
    return {"title": title, "extra": "forbid", "strict": True}


def yaml_metadata(about: str = "", **rules: Any) -> dict[str, Any]:
    """Return the metadata of a field that is written in YAML.

    `about` describes it on reference pages. `rules` are other arguments of pydantic's `Field`: `alias`,
    bounds, `pattern`.
    """
    return {"description": about, **rules}
