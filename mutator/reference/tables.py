"""Markdown of a model: a section with a table of its keys."""

import json
from collections.abc import Iterator
from typing import Any

from mutator.config.yaml_files import StrictModel
from mutator.reference.schemas import definitions
from mutator.reference.words import SECTIONS, TOLD_IN

_SIGNS = {
    "minimum": "at least",
    "maximum": "at most",
    "exclusiveMinimum": "above",
    "exclusiveMaximum": "below",
}
_WORDS = {
    "string": "text",
    "number": "number",
    "integer": "whole number",
    "boolean": "true or false",
    "null": "null",
}


def generated(title: str) -> str:
    """Head of a page."""
    return f"# {title}\n\n<!-- Written by `python -m mutator.reference`; do not edit by hand. -->\n"


def sections(page: str, *models: type[StrictModel], below: int = 1) -> Iterator[str]:
    """A section for each model that files of `models` are made of, each once, in the order of `SECTIONS`.

    Headings are of the level below `below`; with several files, those of their parts are a level deeper. What
    another page tells of is linked there.
    """
    parts: dict[str, dict[str, Any]] = {}
    for model in models:
        parts |= definitions(model)
    told = {name: part for name, part in parts.items() if TOLD_IN.get(name, page) == page}
    enums = {name: told.pop(name)["enum"] for name in parts if "enum" in parts[name]}
    files = {next(iter(definitions(model))) for model in models}
    words = _Words(page, enums)
    for name in sorted(told, key=list(SECTIONS).index):
        title, text = SECTIONS[name]
        deeper = len(models) > 1 and name not in files
        yield f"{'#' * (below + 1 + deeper)} {title}\n"
        if text:
            yield f"{text}\n"
        yield from words.keys(told[name])


class _Words:
    """Types of keys in words, as `page` says them; `enums` are the values of enumerations by name."""

    def __init__(self, page: str, enums: dict[str, list[str]]) -> None:
        self._page = page
        self._enums = enums

    def keys(self, part: dict[str, Any]) -> Iterator[str]:
        """The table of a model's keys."""
        yield "| key | type | default | meaning |"
        yield "|---|---|---|---|"
        required = part.get("required", [])
        for key, value in part["properties"].items():
            default = "needed" if key in required else _default(value)
            yield f"| `{key}` | {self._type(value)} | {default} | {value['description']} |"
        yield ""

    def _type(self, value: dict[str, Any]) -> str:
        """A JSON Schema type in words. What may be left out has null as its default; that is not told."""
        if "anyOf" in value:
            types = [v.get("type") for v in value["anyOf"]]
            # A whole number is a number.
            skipped = {"integer"} if "number" in types else set()
            if value.get("default", "") is None:
                skipped.add("null")
            return " or ".join(self._type(v) for v in value["anyOf"] if v.get("type") not in skipped)
        if "$ref" in value:
            return self._reference(value["$ref"].rpartition("/")[2])
        if "enum" in value:
            return _one_of(value["enum"])
        if value["type"] == "array":
            return f"list of {self._type(value['items'])}"
        if value["type"] == "object":
            inner = value.get("additionalProperties")
            return f"mapping to {self._type(inner)}" if isinstance(inner, dict) else "mapping"
        return _WORDS[value["type"]] + _bounds(value)

    def _reference(self, name: str) -> str:
        if name in self._enums:
            return _one_of(self._enums[name])
        title = SECTIONS[name][0].lower()
        page = TOLD_IN.get(name, self._page)
        return f"[{title}]({'' if page == self._page else page}#{title.replace(' ', '-')})"


def _default(value: dict[str, Any]) -> str:
    given = value.get("default")
    return "-" if given is None or isinstance(given, dict) else f"`{json.dumps(given)}`"


def _one_of(values: list[str]) -> str:
    return " or ".join(f"`{value}`" for value in values)


def _bounds(value: dict[str, Any]) -> str:
    bounds = [f"{word} {value[key]:g}" for key, word in _SIGNS.items() if key in value]
    return f" ({', '.join(bounds)})" if bounds else ""
