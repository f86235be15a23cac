"""Finds classes that copy their fields' defaults, so that setting the class's attribute does nothing.

Examples are pydantic's models, whose validator is compiled from the defaults, and msgspec's structs.
"""

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator.mutants.expression_roles import blocks_of
from mutator.mutants.imported_names import ImportedNames
from mutator.mutants.modules_importing_constants import module_name
from mutator.targets.source_tree import SourceTree

# bases whose classes copy defaults, or read them in a way of their own; by package
_COPYING_BASES_BY_PACKAGE: Mapping[str, frozenset[str]] = {
    "pydantic": frozenset({"BaseModel", "RootModel", "BaseSettings", "GenericModel"}),
    "pydantic_settings": frozenset({"BaseSettings"}),
    "sqlmodel": frozenset({"SQLModel"}),
    "msgspec": frozenset({"Struct"}),
    "traitlets": frozenset({"HasTraits", "Configurable", "SingletonConfigurable", "Application"}),
    "traits": frozenset({"HasTraits", "HasStrictTraits"}),
    "django": frozenset({"Model", "Form", "ModelForm"}),
    "peewee": frozenset({"Model"}),
    "mongoengine": frozenset({"Document", "EmbeddedDocument"}),
    "marshmallow": frozenset({"Schema"}),
    "param": frozenset({"Parameterized"}),
    "enum": frozenset({"Enum", "IntEnum", "StrEnum", "Flag", "IntFlag", "ReprEnum"}),
    "typing": frozenset({"NamedTuple", "TypedDict"}),
    "typing_extensions": frozenset({"NamedTuple", "TypedDict"}),
}
_CLASS_VARIABLE_PATTERN = re.compile(r"\bClassVar\b")
_COPYING_METACLASSES = frozenset({"enum.EnumMeta", "enum.EnumType"})
_COPYING_DECORATORS = frozenset({"pydantic.dataclasses.dataclass"})


@dataclass(frozen=True, slots=True, kw_only=True)
class _ClassBases:
    """What a class derives from, in dotted names: of imports, or of classes in the same file."""

    bases: tuple[str, ...]
    metaclasses: tuple[str, ...]
    decorators: tuple[str, ...]
    class_variables: frozenset[str]  # annotated as `ClassVar`: no fields


def reason_field_is_copied(tree: SourceTree, path: str, name: str, field: str) -> str | None:
    """Return why a class's field cannot be set, such as `its class derives from BaseModel of pydantic`.

    The class is found by its qualified name. Bases are followed through the files of the target. A `ClassVar`
    is no field: the class keeps it as it is.
    """
    facts = tree.derive_once(path, _class_bases_in_file).get(name)
    if facts is None or field in facts.class_variables:
        return None
    return _reason_field_is_copied(tree, path, name, frozenset())


def _reason_field_is_copied(
    tree: SourceTree, path: str, name: str, visited: frozenset[tuple[str, str]]
) -> str | None:
    classes = tree.derive_once(path, _class_bases_in_file)
    if name not in classes or (path, name) in visited:
        return None
    facts = classes[name]
    if match := next((d for d in facts.decorators if d in _COPYING_DECORATORS), None):
        return f"its class is decorated with {match}, which keeps its own copy of each default"
    if match := next((m for m in facts.metaclasses if m in _COPYING_METACLASSES), None):
        return f"its class has the metaclass {match}, which does not allow a new value"
    for base in facts.bases:
        package, _, last = base.rpartition(".")
        if last in _COPYING_BASES_BY_PACKAGE.get(package.partition(".")[0], ()):
            return f"its class derives from {last} of {package}, which does not allow a new value"
        for base_path, base_name in _classes_of_base(tree, path, classes, base):
            if reason := _reason_field_is_copied(tree, base_path, base_name, visited | {(path, name)}):
                return reason
    return None


def _classes_of_base(
    tree: SourceTree, path: str, classes: Mapping[str, _ClassBases], base: str
) -> Iterator[tuple[str, str]]:
    """Yield path and name of the classes that a base can be."""
    if base in classes:
        yield path, base
    module, _, name = base.rpartition(".")
    if module:
        # the root of the target need not be the folder on `sys.path`
        yield from (
            (other, name)
            for other in tree.files
            if other.endswith(".py") and f".{module_name(other)}".endswith(f".{module}")
        )


def _class_bases_in_file(path: str, data: bytes, root: Path) -> Mapping[str, _ClassBases]:
    try:
        module = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError):
        return {}
    return dict(_classes_in_body(module.body, "", ImportedNames(module, path, _COPYING_BASES_BY_PACKAGE)))


def _classes_in_body(
    body: Sequence[ast.stmt], prefix: str, imports: ImportedNames
) -> Iterator[tuple[str, _ClassBases]]:
    def dotted(node: ast.expr) -> str:
        node = node.value if isinstance(node, ast.Subscript) else node  # `Base[float]`
        return imports.dotted_callable(node) or ast.unparse(node)

    for statement in body:
        if isinstance(statement, ast.ClassDef):
            name = f"{prefix}{statement.name}"
            metaclasses = [k.value for k in statement.keywords if k.arg == "metaclass"]
            facts = _ClassBases(
                bases=tuple(map(dotted, statement.bases)),
                metaclasses=tuple(map(dotted, metaclasses)),
                decorators=tuple(map(dotted, statement.decorator_list)),
                class_variables=frozenset(_class_variables(statement.body)),
            )
            yield name, facts
            yield from _classes_in_body(statement.body, f"{name}.", imports)
        elif not isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef):
            for block in blocks_of(statement):
                yield from _classes_in_body(block, prefix, imports)


def _class_variables(body: Sequence[ast.stmt]) -> Iterator[str]:
    for statement in body:
        match statement:
            case ast.AnnAssign(target=ast.Name(id=name), annotation=annotation):
                # `ClassVar[float]`, `typing.ClassVar`, or either in quotes
                if _CLASS_VARIABLE_PATTERN.search(ast.unparse(annotation)):
                    yield name
