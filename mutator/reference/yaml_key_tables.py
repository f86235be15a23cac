"""Markdown sections for models, each with a table of its keys."""

import json
from collections.abc import Iterator
from typing import Any

from mutator._common.table_rendering import TextTable
from mutator.config.yaml_files import StrictModel
from mutator.reference.json_schemas import schema_by_model

# models used in several kinds of files, and the page with their section
_PAGE_BY_SHARED_MODEL = {"Injection": "fault-spec.md", "Location": "fault-spec.md"}
_WORDS_BY_BOUND_KEY = {
    "minimum": "at least",
    "maximum": "at most",
    "exclusiveMinimum": "above",
    "exclusiveMaximum": "below",
}
_WORDS_BY_JSON_TYPE = {
    "string": "text",
    "number": "number",
    "integer": "whole number",
    "boolean": "true or false",
    "null": "null",
}


def generated_page_head(title: str) -> str:
    return f"# {title}\n\n<!-- Written by `python -m mutator.reference`; do not edit by hand. -->\n"


def model_sections(page_name: str, *models: type[StrictModel], parent_level: int = 1) -> Iterator[str]:
    """Yield a section for each model in files of `models`, each once, in the order of their keys.

    Headings are one level below `parent_level`; with several `models`,
    those of their parts are two levels below it.
    Models that other pages describe are only linked.
    """
    schema_by_name: dict[str, dict[str, Any]] = {}
    for model in models:
        schemas = schema_by_model(model)
        schema_by_name |= {name: schemas[name] for name in order_models(schemas)}
    file_models = {next(iter(schema_by_model(model))) for model in models}
    tables = _KeyTables(page_name, schema_by_name)
    for name, part in schema_by_name.items():
        if "enum" in part or _PAGE_BY_SHARED_MODEL.get(name, page_name) != page_name:
            continue
        is_deeper = len(models) > 1 and name not in file_models
        yield f"{'#' * (parent_level + 1 + is_deeper)} {part['title']}\n"
        if part["description"]:
            yield f"{part['description']}\n"
        yield from tables.key_table(part)


def order_models(schema_by_name: dict[str, dict[str, Any]]) -> list[str]:
    """Return the names of models in reading order: the first, then those that its keys refer to."""
    ordered: dict[str, None] = {}
    waiting = [next(iter(schema_by_name))]
    while waiting:
        name = waiting.pop()
        if name not in ordered:
            ordered[name] = None
            # a stack, so reversed: the first reference comes next
            waiting += reversed(list(_referenced_models(schema_by_name[name])))
    return list(ordered)


def _referenced_models(value: Any) -> Iterator[str]:
    if isinstance(value, list):
        for item in value:
            yield from _referenced_models(item)
    elif isinstance(value, dict):
        for key, inner in value.items():
            if key == "$ref":
                yield inner.rpartition("/")[2]
            else:
                yield from _referenced_models(inner)


class _KeyTables:
    def __init__(self, page: str, parts: dict[str, dict[str, Any]]) -> None:
        self._page = page
        self._parts = parts

    def key_table(self, part: dict[str, Any]) -> Iterator[str]:
        required = part.get("required", [])
        rows = [
            (
                f"`{key}`",
                self._type_text(value),
                "required" if key in required else _default_text(value),
                value["description"],
            )
            for key, value in part["properties"].items()
        ]
        yield TextTable(heads=("key", "type", "default", "meaning"), rows=rows).as_markdown(escape=False)
        yield ""

    def _type_text(self, value: dict[str, Any]) -> str:
        """Return a JSON Schema type as text; for optional keys, null is left out."""
        if "oneOf" in value:  # with a rule that chooses one
            value = {**value, "anyOf": value["oneOf"]}
        if "anyOf" in value:
            types = [v.get("type") for v in value["anyOf"]]
            # "number" includes whole numbers
            skipped = {"integer"} if "number" in types else set()
            if value.get("default", "") is None:
                skipped.add("null")
            return " or ".join(self._type_text(v) for v in value["anyOf"] if v.get("type") not in skipped)
        if "$ref" in value:
            return self._reference_text(value["$ref"].rpartition("/")[2])
        if "enum" in value:
            return _alternatives_text(value["enum"])
        if value["type"] == "array":
            return f"list of {self._type_text(value['items'])}"
        if value["type"] == "object":
            inner = value.get("additionalProperties")
            return f"mapping to {self._type_text(inner)}" if isinstance(inner, dict) else "mapping"
        return _WORDS_BY_JSON_TYPE[value["type"]] + _bounds_text(value)

    def _reference_text(self, name: str) -> str:
        part = self._parts[name]
        if "enum" in part:
            return _alternatives_text(part["enum"])
        title = part["title"].lower()
        page = _PAGE_BY_SHARED_MODEL.get(name, self._page)
        return f"[{title}]({'' if page == self._page else page}#{title.replace(' ', '-')})"


def _default_text(value: dict[str, Any]) -> str:
    default = value.get("default")
    return "-" if default is None or isinstance(default, dict) else f"`{json.dumps(default)}`"


def _alternatives_text(values: list[str]) -> str:
    return " or ".join(f"`{value}`" for value in values)


def _bounds_text(value: dict[str, Any]) -> str:
    bounds = [f"{word} {value[key]:g}" for key, word in _WORDS_BY_BOUND_KEY.items() if key in value]
    return f" ({', '.join(bounds)})" if bounds else ""
