"""Markdown sections for models, each with a table of its keys."""

import json
from collections.abc import Iterator
from typing import Any

from mutator._common.table_rendering import Table
from mutator.config.yaml_files import StrictModel
from mutator.reference.json_schemas import definitions

# models used in several kinds of files, and the page with their section
_PAGES = {"Injection": "fault-spec.md", "At": "fault-spec.md"}
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
    return f"# {title}\n\n<!-- Written by `python -m mutator.reference`; do not edit by hand. -->\n"


def sections(page: str, *models: type[StrictModel], below: int = 1) -> Iterator[str]:
    """Yield a section for each model in files of `models`, each once, in the order of their keys.

    Headings are one level below `below`; with several `models`, those of their parts are two levels below it.
    Models that other pages describe are only linked.
    """
    parts: dict[str, dict[str, Any]] = {}
    for model in models:
        known = definitions(model)
        parts |= {name: known[name] for name in reading_order(known)}
    files = {next(iter(definitions(model))) for model in models}
    tables = _Tables(page, parts)
    for name, part in parts.items():
        if "enum" in part or _PAGES.get(name, page) != page:
            continue
        deeper = len(models) > 1 and name not in files
        yield f"{'#' * (below + 1 + deeper)} {part['title']}\n"
        if part["description"]:
            yield f"{part['description']}\n"
        yield from tables.keys(part)


def reading_order(parts: dict[str, dict[str, Any]]) -> list[str]:
    """Return the names of models in reading order: the first, then those that its keys refer to."""
    met: dict[str, None] = {}
    waiting = [next(iter(parts))]
    while waiting:
        name = waiting.pop()
        if name not in met:
            met[name] = None
            waiting += reversed(list(_references(parts[name])))
    return list(met)


def _references(value: Any) -> Iterator[str]:
    if isinstance(value, list):
        for item in value:
            yield from _references(item)
    elif isinstance(value, dict):
        for key, inner in value.items():
            if key == "$ref":
                yield inner.rpartition("/")[2]
            else:
                yield from _references(inner)


class _Tables:
    def __init__(self, page: str, parts: dict[str, dict[str, Any]]) -> None:
        self._page = page
        self._parts = parts

    def keys(self, part: dict[str, Any]) -> Iterator[str]:
        required = part.get("required", [])
        rows = [
            (
                f"`{key}`",
                self._type(value),
                "required" if key in required else _default(value),
                value["description"],
            )
            for key, value in part["properties"].items()
        ]
        yield Table(heads=("key", "type", "default", "meaning"), rows=rows).as_markdown(escape=False)
        yield ""

    def _type(self, value: dict[str, Any]) -> str:
        """Return a JSON Schema type as text; for optional keys, null is left out."""
        if "anyOf" in value:
            types = [v.get("type") for v in value["anyOf"]]
            # "number" includes whole numbers
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
        part = self._parts[name]
        if "enum" in part:
            return _one_of(part["enum"])
        title = part["title"].lower()
        page = _PAGES.get(name, self._page)
        return f"[{title}]({'' if page == self._page else page}#{title.replace(' ', '-')})"


def _default(value: dict[str, Any]) -> str:
    given = value.get("default")
    return "-" if given is None or isinstance(given, dict) else f"`{json.dumps(given)}`"


def _one_of(values: list[str]) -> str:
    return " or ".join(f"`{value}`" for value in values)


def _bounds(value: dict[str, Any]) -> str:
    bounds = [f"{word} {value[key]:g}" for key, word in _SIGNS.items() if key in value]
    return f" ({', '.join(bounds)})" if bounds else ""
