"""Read YAML strictly, and keep the line of every value for error messages.

The dialect is the core of YAML 1.2, without tags, anchors or aliases (with which a small file could
expand to gigabytes), and without multiple documents or duplicate keys.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

import yaml
from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationError
from pydantic_core import CoreSchema

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import check_schema
from mutator._common.message_text import counted, shortened_repr
from mutator.config import pydantic_error_messages
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.errors import MutatorError

ModelT = TypeVar("ModelT", bound="StrictModel")
RecordT = TypeVar("RecordT")

MOST_YAML_BYTES = 1_000_000
MOST_YAML_DEPTH = 40  # nested lists and mappings
MOST_YAML_VALUES = 100_000  # keys, texts, numbers, lists and mappings
# YAML ends a line also at these, unlike an editor; line numbers count as the parser does
_LINE_BREAK_PATTERN = re.compile(r"\r\n|[\r\n\x85\u2028\u2029]")
_DIRECTIVE_PATTERN = re.compile(r"(?:\A\ufeff?|[\r\n\x85\u2028\u2029])%")
_YAML12_SCALAR_PATTERNS = {
    "bool": ("tTfF", r"true|True|TRUE|false|False|FALSE"),
    "null": ("~nN\0", r"~|null|Null|NULL|"),
    "int": ("-+0123456789", r"[-+]?[0-9]{1,300}"),  # longer integers are floats, infinite if too large
    "float": (
        "-+.0123456789",
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
    ),
}


class StrictModel(BaseModel):
    """Base of all file models: rejects unknown keys and does not convert types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)


class _AcceptsMapping:
    def __get_pydantic_core_schema__(self, record: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema = handler(record)
        resolved = cast(dict[str, Any], handler.resolve_ref_schema(schema))
        resolved["strict"] = False  # a mapping, not only an instance
        return schema


YamlRecord = Annotated[RecordT, _AcceptsMapping()]
"""A dataclass in a file model, with fields of `yaml_metadata` and a configuration of
`pydantic_mapping_config`.
"""


# the loader in C is many times as fast, but an installation of PyYAML can lack it
class _Yaml12Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """The safe loader with the scalars of YAML 1.2: `on`, `no` and `1:30` are text."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012


for _kind, (_first, _pattern) in _YAML12_SCALAR_PATTERNS.items():
    for _character in _first:
        _Yaml12Loader.yaml_implicit_resolvers.setdefault("" if _character == "\0" else _character, []).append(
            (f"tag:yaml.org,2002:{_kind}", re.compile(rf"(?:{_pattern})\Z"))
        )


def load_yaml(path: Path) -> YamlSource:
    return parse_yaml(_read_text(path), path)


def parse_yaml(text: str, path: Path) -> YamlSource:
    """Parse text as `load_yaml` does; errors name `path`."""
    try:
        _check_syntax(text, path)
        node = yaml.compose(text, Loader=_Yaml12Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise MutatorError(
            f"not valid YAML: {error.problem or error.context}",
            where=path,
            line=mark.line + 1 if mark is not None else None,
            remedy="check indentation, colons and quotes around this line",
        ) from None
    except yaml.YAMLError as error:
        raise MutatorError(f"not valid YAML: {error}", where=path, remedy="save it as plain text") from None
    lines: dict[KeyPath, int] = {}
    data = _build_value(node, (), lines, path) if node is not None else None
    return YamlSource(path=path, data=data, lines=lines)


def _read_text(path: Path) -> str:
    try:
        text = read_bounded(path, MOST_YAML_BYTES).decode()
        return text.replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise MutatorError(
            f"not UTF-8 (byte {error.object[error.start]:#04x} at offset {error.start})",
            where=path,
            remedy="save the file as UTF-8",
        ) from None
    except OSError as error:
        raise MutatorError(
            f"cannot be read ({error.strerror})", where=path, remedy="check the path and its permissions"
        ) from None


def _check_syntax(text: str, path: Path) -> None:
    """Reject excluded syntax and large files before building any value."""
    if directive := _DIRECTIVE_PATTERN.search(text):
        raise MutatorError(
            "'%' at the start of a line (a directive)",
            where=path,
            line=len(_LINE_BREAK_PATTERN.findall(text, 0, directive.end())) + 1,
            expected="plain values",
            remedy="remove or indent it",
        )
    documents = depth = values = 0
    for event in yaml.parse(text, Loader=_Yaml12Loader):
        line = event.start_mark.line + 1 if event.start_mark else None
        anchor = getattr(event, "anchor", None)
        tag = getattr(event, "tag", None)
        if anchor or tag:
            raise MutatorError(
                f"'{tag}' (a tag)" if tag else f"'{anchor}' (an anchor or alias)",
                where=path,
                line=line,
                expected="plain values",
                remedy="write the value out",
            )
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        values += isinstance(event, yaml.NodeEvent)
        documents += isinstance(event, yaml.DocumentStartEvent)
        if documents > 1:
            raise MutatorError(
                "a second document",
                where=path,
                line=line,
                expected="one document in each file",
                remedy="remove the `---` above it",
            )
        if depth > MOST_YAML_DEPTH or values > MOST_YAML_VALUES:
            raise MutatorError(
                "nested too deeply" if depth > MOST_YAML_DEPTH else "too many values",
                where=path,
                line=line,
                expected=f"at most {MOST_YAML_VALUES} values, nested at most {MOST_YAML_DEPTH} deep",
                remedy="flatten the file" if depth > MOST_YAML_DEPTH else "split it",
            )


def _build_value(node: yaml.Node, keys: KeyPath, lines: dict[KeyPath, int], path: Path) -> Any:
    lines.setdefault(keys, node.start_mark.line + 1)
    if isinstance(node, yaml.MappingNode):
        return _build_mapping(node, keys, lines, path)
    if isinstance(node, yaml.SequenceNode):
        return [_build_value(item, (*keys, i), lines, path) for i, item in enumerate(node.value)]
    _check_no_nul(node, path)
    return _parse_scalar(node.tag.rpartition(":")[2], node.value)


def _build_mapping(
    node: yaml.MappingNode, keys: KeyPath, lines: dict[KeyPath, int], path: Path
) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key_node, value_node in node.value:
        line = key_node.start_mark.line + 1
        if not key_node.tag.endswith(":str"):
            raise MutatorError(
                f"key {key_node.value!r}", where=path, line=line, expected="text", remedy="put it in quotes"
            )
        _check_no_nul(key_node, path)
        key = key_node.value
        if key in result:
            raise MutatorError(
                f"duplicate key '{key}'",
                where=path,
                line=line,
                expected=f"the key once (it is also in line {lines[(*keys, key)]})",
                remedy="remove one of the two",
            )
        lines[(*keys, key)] = line
        result[key] = _build_value(value_node, (*keys, key), lines, path)
    return result


def _check_no_nul(node: yaml.Node, path: Path) -> None:
    """Refuse NUL, which no file name, argument or variable can contain."""
    if "\0" in node.value:
        line = node.start_mark.line + 1
        raise MutatorError(
            f"{node.value!a}", where=path, line=line, expected="text without NUL", remedy="remove it"
        )


def _parse_scalar(kind: str, text: str) -> Any:
    if kind == "null":
        return None
    if kind == "bool":
        return text.lower() == "true"
    if kind == "int":
        return int(text)
    if kind == "float":
        return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    return text


def load_yaml_model(
    path: Path, model: type[ModelT], schema: str, prepare: Callable[[YamlSource], YamlSource] | None = None
) -> tuple[ModelT, YamlSource]:
    """Parse `path`, check its key `schema: name/version` against `schema`, and validate the rest as `model`.

    `prepare` changes the content before it is validated. MutatorError for an invalid file or another schema.
    """
    source = load_yaml(path)
    if not isinstance(source.data, dict):
        raise source.error(
            (),
            f"{shortened_repr(source.data)}",
            expected="a mapping of keys to values",
            remedy="write `key: value` lines",
        )
    remedy = f"start the file with `schema: {schema}`, and follow its page"
    check_schema(source.data.get("schema"), schema, path, line=source.line_of(("schema",)), remedy=remedy)
    if prepare is not None:
        source = prepare(source)
    body = {key: value for key, value in source.data.items() if key != "schema"}
    try:
        return model.model_validate(body), source
    except ValidationError as error:
        errors = error.errors(include_url=False)
        got, expected, remedy, keys = pydantic_error_messages.got_expected_remedy_and_keys(
            pydantic_error_messages.choose_error_to_report(errors), model
        )
        if len(errors) > 1:
            remedy += f" ({counted(len(errors) - 1, 'more mistake')} after this one)"
        raise source.error(keys, got, expected=expected, remedy=remedy) from None
