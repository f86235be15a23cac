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
from mutator._common.table_rendering import Table
from mutator.reference.yaml_key_tables import generated
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
_ARGUMENTS = (
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
_DOC_COMMENT = re.compile(r"#: ?(.*)")
_EXCEPTION, _ENUMERATION, _CLASS = "Errors and warnings", "Enumerations", "Classes"

Function = ast.FunctionDef


@dataclass(frozen=True, kw_only=True)
class Member:
    """A public attribute, property or method of a class."""

    name: str
    written: str
    type: str
    meaning: str


def render_api_page(workspace: Workspace) -> str:
    shared = Table(heads=("argument", "what you can pass"), rows=_ARGUMENTS).as_markdown(escape=False)
    parts = [generated("Python API"), _INTRO, shared, "\n## Functions\n"]
    for name in _functions():
        parts += _function(name)
    for title in (_CLASS, _ENUMERATION, _EXCEPTION):
        parts.append(f"## {title}\n")
        for name, cls in _classes().items():
            if _kind(cls) == title:
                parts += _class(name, cls)
    return "\n".join(parts).rstrip() + "\n"


def undocumented() -> list[str]:
    """Return the public functions, classes, attributes and methods without documentation."""
    missing = [name for name in (*_functions(), *_classes()) if not _parsed(getattr(mutator, name))[1]]
    for name, cls in _classes().items():
        missing += [f"{name}.{member.name}" for member in members(cls) if not member.meaning]
    return missing


def members(cls: type) -> list[Member]:
    """Return the public members of a class: its own, then those inherited from classes that are not
    public.
    """
    public = set(_classes().values()) - {cls}
    found: dict[str, Member] = {}
    for base in cls.__mro__:
        if base.__module__.partition(".")[0] == "mutator" and base not in public:
            for member in _own_members(base):
                found.setdefault(member.name, member)
    return list(found.values())


def _functions() -> list[str]:
    return [name for name in mutator.__all__ if inspect.isfunction(getattr(mutator, name))]


def _classes() -> dict[str, type]:
    return {name: cls for name in mutator.__all__ if inspect.isclass(cls := getattr(mutator, name))}


def _kind(cls: type) -> str:
    if issubclass(cls, BaseException):
        return _EXCEPTION
    return _ENUMERATION if issubclass(cls, Enum) else _CLASS


def _function(name: str) -> Iterator[str]:
    node, text = _parsed(getattr(mutator, name))
    signature = _signature(node, f"mutator.{name}", lines=True)
    yield f"### mutator.{name}\n"
    yield f"```python\n{signature}\n```\n"
    yield f"{text}\n"
    if links := [f"[{known}](#{known.lower()})" for known in _public_in(signature)]:
        yield f"See {', '.join(links)}.\n"


def _class(name: str, cls: type) -> Iterator[str]:
    yield f"### {name}\n"
    yield f"{_parsed(cls)[1]}\n"
    parents = [base.__name__ for base in cls.__mro__[1:] if base in _classes().values()]
    if parents:
        yield f"It has the members of [{parents[0]}](#{parents[0].lower()}).\n"
    rows = [tuple(map(_cell, (f"`{one.written}`", _type(one.type), one.meaning))) for one in members(cls)]
    if rows:
        heads = ("member", "value" if issubclass(cls, Enum) else "type", "meaning")
        yield Table(heads=heads, rows=rows).as_markdown(escape=False)
        yield ""


def _cell(text: str) -> str:
    return " ".join(text.replace("|", r"\|").split())


def _type(text: str) -> str:
    code = f"`{text}`" if text else ""
    known = _public_in(text)
    return f"[{code}](#{known[0].lower()})" if known else code


def _public_in(text: str) -> list[str]:
    return list(dict.fromkeys(name for name in re.findall(r"\w+", text) if name in _classes()))


def _parsed(thing: Any) -> tuple[Any, str]:
    node: Any = ast.parse(dedent(inspect.getsource(thing))).body[0]
    return node, ast.get_docstring(node) or ""


def _own_members(cls: type) -> Iterator[Member]:
    if issubclass(cls, Enum) and hasattr(cls, "about"):  # its members are not in its source
        for one in cls:
            meaning = f"{one.about[0].upper()}{one.about[1:]}."
            yield Member(name=one.name, written=one.name, type=_type_of(one), meaning=meaning)
        return
    lines = dedent(inspect.getsource(cls)).splitlines()
    for node in _parsed(cls)[0].body:
        if isinstance(node, Function):
            if node.name == "__init__":
                yield from _assigned_to_self(node, lines)
            elif not node.name.startswith("_"):
                yield _method(node)
        elif isinstance(node, ast.AnnAssign | ast.Assign):
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            name = ast.unparse(target)
            if not name.startswith("_"):
                type_ = _annotation(node) if isinstance(node, ast.AnnAssign) else _type_of(getattr(cls, name))
                yield Member(name=name, written=name, type=type_, meaning=_comment(node, lines))


def _assigned_to_self(init: Function, lines: list[str]) -> Iterator[Member]:
    types = {arg.arg: _annotation(arg) for arg in (*init.args.args, *init.args.kwonlyargs)}
    for node in init.body:
        if isinstance(node, ast.Assign) and isinstance(target := node.targets[0], ast.Attribute):
            name = target.attr
            yield Member(name=name, written=name, type=types.get(name, ""), meaning=_comment(node, lines))


def _comment(node: ast.stmt, lines: list[str]) -> str:
    own = [
        found[1] for line in lines[node.lineno - 1 : node.end_lineno] if (found := _DOC_COMMENT.search(line))
    ]
    above: list[str] = []
    at = node.lineno - 2
    while not own and (found := _DOC_COMMENT.fullmatch(lines[at].strip())):
        above.insert(0, found[1])
        at -= 1
    text = " ".join(own or above)
    return f"{text[0].upper()}{text[1:]}." if text else ""


def _method(node: Function) -> Member:
    kinds = {ast.unparse(decorator) for decorator in node.decorator_list}
    written = node.name if kinds & {"property", "cached_property"} else _signature(node, node.name)
    return Member(
        name=node.name,
        written=written,
        type=_returned(node),
        meaning=(ast.get_docstring(node) or ""),
    )


def _returned(node: Function) -> str:
    return _plain(node.returns) if node.returns else ""


def _annotation(node: ast.arg | ast.AnnAssign) -> str:
    return _plain(node.annotation) if node.annotation else ""


def _plain(annotation: ast.expr) -> str:
    return ast.unparse(annotation).strip("'")


def _type_of(value: Any) -> str:
    return f'"{value.value}"' if isinstance(value, Enum) else type(value).__name__


def _signature(node: Function, name: str, *, lines: bool = False) -> str:
    """Return the signature as a call; with `lines`, typed and with one argument per line."""
    args = node.args
    positional = [*args.posonlyargs, *args.args]
    defaults: list[ast.expr | None] = [None] * (len(positional) - len(args.defaults))
    texts = [_argument(a, d, lines) for a, d in zip(positional, [*defaults, *args.defaults], strict=True)]
    texts = [text for text, arg in zip(texts, positional, strict=True) if arg.arg not in ("self", "cls")]
    if args.vararg:
        texts.append(f"*{_argument(args.vararg, None, lines)}")
    elif args.kwonlyargs:
        texts.append("*")
    texts += [_argument(a, d, lines) for a, d in zip(args.kwonlyargs, args.kw_defaults, strict=True)]
    if not lines:
        return f"{name}({', '.join(texts)})"
    inside = "".join(f"\n    {text}," for text in texts) + "\n" if texts else ""
    return f"{name}({inside}) -> {_returned(node)}"


def _argument(arg: ast.arg, default: ast.expr | None, typed: bool) -> str:
    text = f"{arg.arg}: {_annotation(arg)}" if typed and arg.annotation else arg.arg
    if default is None:
        return text
    return f"{text} = {ast.unparse(default)}" if typed else f"{text}={ast.unparse(default)}"


def render_stub() -> str:
    """Return `mutator/__init__.pyi`: type checkers cannot follow names that are imported on first use."""
    lines = [
        f"from {module} import {name} as {name}"
        for module, names in sorted(mutator.HOMES.items())
        for name in sorted(names)
    ]
    exported = ",\n".join(f'    "{name}"' for name in mutator.__all__)
    head = "# Generated from `HOMES` in __init__.py by `python -m mutator.reference`; do not edit."
    return "\n".join(
        [
            head,
            *lines,
            "",
            "HOMES: dict[str, tuple[str, ...]]",
            "__version__: str",
            "",
            f"__all__ = [\n{exported},\n]",
            "",
        ]
    )
