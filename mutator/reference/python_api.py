"""Generate the page of the Python API from the signatures and docstrings of `mutator.__all__`.

A `#:` comment on an attribute's line, or above it, documents the attribute.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from textwrap import dedent
from typing import Any

import mutator
from mutator._common.table_rendering import TextTable
from mutator.reference.yaml_key_tables import generated_page_head
from mutator.workspace import Workspace

_INTRO = """\
`import mutator` offers the names on this page and no others. They are typed and stable: the
[changelog](../../CHANGELOG.md) announces every change. Anything else below `mutator` can change at any time.
The import is fast, because each name is loaded when you first use it.

No function prints. Invalid input raises [MutatorError](#mutatorerror).
A notebook shows most objects as a small table.
[Use mutator in a notebook](../how-to/use-in-a-notebook.md) has examples.

## Shared arguments
"""
_SHARED_ARGUMENTS = (
    (
        "`fault: FaultLike`",
        "a `Fault`, a spec (`sensor/bias`), a variant (`sensor/bias/distance`), a spec file",
    ),
    (
        "`trigger: TriggerLike`",
        "a `Trigger`, a context (`C2`), a time in s, `always`, a condition (`gap <= 2`)",
    ),
    (
        "`workspace: WorkspaceLike`",
        "a `Workspace`, or the folder that holds `fault_library/`; default: as on the command line",
    ),
    ("`target`", "the name or file of a target's manifest; default: the only one in the library"),
    (
        "`value`, `reading`, `seed`",
        "for a fault given by name: its value in the spec's unit, its reading, and the seed of the draw",
    ),
    ("`choices`", "`Choices` that override the campaign file"),
)
_DOC_COMMENT_PATTERN = re.compile(r"#: ?(.*)")
_EXCEPTION, _ENUMERATION, _CLASS = "Errors and warnings", "Enumerations", "Classes"

FunctionNode = ast.FunctionDef


@dataclass(frozen=True, kw_only=True)
class ApiMember:
    """A public attribute, property or method of a class."""

    name: str
    signature: str
    type: str
    meaning: str


def render_api_page(workspace: Workspace) -> str:
    shared = TextTable(heads=("argument", "what you can pass"), rows=_SHARED_ARGUMENTS).as_markdown(
        escape=False
    )
    parts = [generated_page_head("Python API"), _INTRO, shared, "\n## Functions\n"]
    for name in _public_functions():
        parts += _function_section(name)
    for title in (_CLASS, _ENUMERATION, _EXCEPTION):
        parts.append(f"## {title}\n")
        for name, cls in _public_classes().items():
            if _heading_of(cls) == title:
                parts += _class_section(name, cls)
    return "\n".join(parts).rstrip() + "\n"


def list_undocumented() -> list[str]:
    """Return the public functions, classes, attributes and methods without documentation."""
    missing = [
        name
        for name in (*_public_functions(), *_public_classes())
        if not _node_and_docstring(getattr(mutator, name))[1]
    ]
    for name, cls in _public_classes().items():
        missing += [f"{name}.{member.name}" for member in members_of(cls) if not member.meaning]
    return missing


def members_of(cls: type) -> list[ApiMember]:
    """Return the public members of a class: its own, then those inherited from classes that are not
    public.
    """
    public = set(_public_classes().values()) - {cls}
    member_by_name: dict[str, ApiMember] = {}
    for base in cls.__mro__:
        if base.__module__.partition(".")[0] == "mutator" and base not in public:
            for member in _members_defined_in(base):
                member_by_name.setdefault(member.name, member)  # a class can override inherited members
    return list(member_by_name.values())


def _public_functions() -> list[str]:
    return [name for name in mutator.__all__ if inspect.isfunction(getattr(mutator, name))]


def _public_classes() -> dict[str, type]:
    return {name: cls for name in mutator.__all__ if inspect.isclass(cls := getattr(mutator, name))}


def _heading_of(cls: type) -> str:
    if issubclass(cls, BaseException):
        return _EXCEPTION
    return _ENUMERATION if issubclass(cls, Enum) else _CLASS


def _function_section(name: str) -> Iterator[str]:
    node, text = _node_and_docstring(getattr(mutator, name))
    signature_text = _signature_text(node, f"mutator.{name}", one_per_line=True)
    yield f"### mutator.{name}\n"
    yield f"```python\n{signature_text}\n```\n"
    yield f"{text}\n"
    if links := [
        f"[{class_name}](#{class_name.lower()})" for class_name in _public_classes_in(signature_text)
    ]:
        yield f"See {', '.join(links)}.\n"


def _class_section(name: str, cls: type) -> Iterator[str]:
    yield f"### {name}\n"
    yield f"{_node_and_docstring(cls)[1]}\n"
    parents = [base.__name__ for base in cls.__mro__[1:] if base in _public_classes().values()]
    if parents:
        yield f"It has the members of [{parents[0]}](#{parents[0].lower()}).\n"
    rows = [
        tuple(map(_one_line_cell, (f"`{member.signature}`", _linked_type(member.type), member.meaning)))
        for member in members_of(cls)
    ]
    if rows:
        heads = ("member", "value" if issubclass(cls, Enum) else "type", "meaning")
        yield TextTable(heads=heads, rows=rows).as_markdown(escape=False)
        yield ""


def _one_line_cell(text: str) -> str:
    return " ".join(text.replace("|", r"\|").split())


def _linked_type(text: str) -> str:
    code = f"`{text}`" if text else ""
    classes = _public_classes_in(text)
    return f"[{code}](#{classes[0].lower()})" if classes else code


def _public_classes_in(text: str) -> list[str]:
    return list(dict.fromkeys(name for name in re.findall(r"\w+", text) if name in _public_classes()))


def _node_and_docstring(definition: Any) -> tuple[Any, str]:
    node: Any = ast.parse(dedent(inspect.getsource(definition))).body[0]
    return node, ast.get_docstring(node) or ""


def _members_defined_in(cls: type) -> Iterator[ApiMember]:
    if issubclass(cls, Enum) and hasattr(cls, "about"):  # its members are not in its source
        for member in cls:
            meaning = f"{member.about[0].upper()}{member.about[1:]}."
            yield ApiMember(
                name=member.name, signature=member.name, type=_type_of_value(member), meaning=meaning
            )
        return
    lines = dedent(inspect.getsource(cls)).splitlines()
    for node in _node_and_docstring(cls)[0].body:
        if isinstance(node, FunctionNode):
            if node.name == "__init__":
                yield from _members_set_in_init(node, lines)
            elif not node.name.startswith("_"):
                yield _method_member(node)
        elif isinstance(node, ast.AnnAssign | ast.Assign):
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            name = ast.unparse(target)
            if not name.startswith("_"):
                type_ = (
                    _annotation_text(node)
                    if isinstance(node, ast.AnnAssign)
                    else _type_of_value(getattr(cls, name))
                )
                yield ApiMember(name=name, signature=name, type=type_, meaning=_doc_comment_of(node, lines))


def _members_set_in_init(init: FunctionNode, lines: list[str]) -> Iterator[ApiMember]:
    types = {arg.arg: _annotation_text(arg) for arg in (*init.args.args, *init.args.kwonlyargs)}
    for node in init.body:
        if isinstance(node, ast.Assign) and isinstance(target := node.targets[0], ast.Attribute):
            name = target.attr
            yield ApiMember(
                name=name, signature=name, type=types.get(name, ""), meaning=_doc_comment_of(node, lines)
            )


def _doc_comment_of(node: ast.stmt, lines: list[str]) -> str:
    in_line = [
        match[1]
        for line in lines[node.lineno - 1 : node.end_lineno]
        if (match := _DOC_COMMENT_PATTERN.search(line))
    ]
    above: list[str] = []
    line_index = node.lineno - 2
    while not in_line and (match := _DOC_COMMENT_PATTERN.fullmatch(lines[line_index].strip())):
        above.insert(0, match[1])
        line_index -= 1
    text = " ".join(in_line or above)
    return f"{text[0].upper()}{text[1:]}." if text else ""


def _method_member(node: FunctionNode) -> ApiMember:
    kinds = {ast.unparse(decorator) for decorator in node.decorator_list}
    signature_text = (
        node.name if kinds & {"property", "cached_property"} else _signature_text(node, node.name)
    )
    return ApiMember(
        name=node.name,
        signature=signature_text,
        type=_return_type(node),
        meaning=(ast.get_docstring(node) or ""),
    )


def _return_type(node: FunctionNode) -> str:
    return _unquoted_text(node.returns) if node.returns else ""


def _annotation_text(node: ast.arg | ast.AnnAssign) -> str:
    return _unquoted_text(node.annotation) if node.annotation else ""


def _unquoted_text(annotation: ast.expr) -> str:
    # quoted if the type is imported only for checking
    return ast.unparse(annotation).strip("'")


def _type_of_value(value: Any) -> str:
    return f'"{value.value}"' if isinstance(value, Enum) else type(value).__name__


def _signature_text(node: FunctionNode, name: str, *, one_per_line: bool = False) -> str:
    """Return the signature as a call; with `one_per_line`, typed and with one argument per line."""
    args = node.args
    positional = [*args.posonlyargs, *args.args]
    defaults: list[ast.expr | None] = [None] * (len(positional) - len(args.defaults))
    texts = [
        _argument_text(a, d, one_per_line)
        for a, d in zip(positional, [*defaults, *args.defaults], strict=True)
    ]
    texts = [text for text, arg in zip(texts, positional, strict=True) if arg.arg not in ("self", "cls")]
    if args.vararg:
        texts.append(f"*{_argument_text(args.vararg, None, one_per_line)}")
    elif args.kwonlyargs:  # after `*args`, no `*` is needed
        texts.append("*")
    texts += [
        _argument_text(a, d, one_per_line) for a, d in zip(args.kwonlyargs, args.kw_defaults, strict=True)
    ]
    if not one_per_line:
        return f"{name}({', '.join(texts)})"
    argument_lines = "".join(f"\n    {text}," for text in texts) + "\n" if texts else ""
    return f"{name}({argument_lines}) -> {_return_type(node)}"


def _argument_text(arg: ast.arg, default: ast.expr | None, with_type: bool) -> str:
    text = f"{arg.arg}: {_annotation_text(arg)}" if with_type and arg.annotation else arg.arg
    if default is None:
        return text
    return f"{text} = {ast.unparse(default)}" if with_type else f"{text}={ast.unparse(default)}"


def render_stub() -> str:
    """Return `mutator/__init__.pyi`: type checkers cannot follow names that are imported on first use."""
    lines = [
        f"from {module} import {name} as {name}"
        for module, names in sorted(mutator.NAMES_BY_MODULE.items())
        for name in sorted(names)
    ]
    exported = ",\n".join(f'    "{name}"' for name in mutator.__all__)
    head = "# Generated from `NAMES_BY_MODULE` in __init__.py by `python -m mutator.reference`; do not edit."
    return "\n".join(
        [
            head,
            *lines,
            "",
            "NAMES_BY_MODULE: dict[str, tuple[str, ...]]",
            "__version__: str",
            "",
            f"__all__ = [\n{exported},\n]",
            "",
        ]
    )
