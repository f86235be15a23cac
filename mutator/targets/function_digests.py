"""Digests of the functions in a target's source, without line numbers, comments and layout.

They tell whether code that a run executed has changed. Whatever is outside of named functions is one part of
its file, which runs when the file is imported. A function inside of a function is part of the outer one.
"""

import ast
import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mutator._common.hashing import digest
from mutator.targets.source_tree import SourceTree

MODULE_PART = "<module>"  # the name of what is outside of functions
_DIGEST_DIGITS = 32  # hexadecimal, of a digest
# names by which code can find out its own line numbers
_LINE_READING_PATTERN = re.compile(
    r"'(\w*lineno\w*|co_lines|co_linetable|co_positions|extract_(stack|tb)|findsource|format_(exc|stack|tb)"
    r"|format_exception|getframeinfo|getsourcelines|traceback)'"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FilePart:
    """A function of a file, or what is outside of them. `reads_lines`: whether it can read line numbers."""

    digest: str
    reads_lines: bool


def parts_of_file(tree: SourceTree, path: str) -> Mapping[str, FilePart]:
    """Return the parts of a Python file by the qualified names of the functions.

    Functions of the same name are one part. A file that Python cannot parse has only what is outside of
    functions. MutatorError if the tree has no such file.
    """
    return tree.derive_once(path, _parse_parts)


def part_name(parts: Mapping[str, FilePart], code_name: str) -> str:
    """Return the name of the part that has the code of this qualified name, which can be that of a class."""
    return code_name if code_name in parts else MODULE_PART


def _parse_parts(path: str, data: bytes, root: Path) -> Mapping[str, FilePart]:
    try:
        module = ast.parse(data)
        functions = _FunctionCutter()
        functions.visit(module)
        texts_by_name = {**functions.texts_by_name, MODULE_PART: [ast.dump(module)]}
    except (SyntaxError, ValueError, RecursionError):
        return {MODULE_PART: FilePart(digest=digest(data)[:_DIGEST_DIGITS], reads_lines=True)}
    return {
        name: FilePart(
            digest=digest(texts)[:_DIGEST_DIGITS],
            reads_lines=any(map(_LINE_READING_PATTERN.search, texts)),
        )
        for name, texts in texts_by_name.items()
    }


class _FunctionCutter(ast.NodeVisitor):
    """Takes the bodies of the functions out of a module, and keeps each function's text by its name.

    Decorators, default arguments and annotations stay, because they run when the function is defined.
    """

    def __init__(self) -> None:
        self.texts_by_name: defaultdict[str, list[str]] = defaultdict(list)
        self._class_prefix = ""

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        outer, self._class_prefix = self._class_prefix, f"{self._class_prefix}{node.name}."
        self.generic_visit(node)
        self._class_prefix = outer

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        self.texts_by_name[f"{self._class_prefix}{node.name}"].append(ast.dump(node))
        node.body = []

    def visit_AsyncFunctionDef(self, node: ast.AsyncFunctionDef) -> None:
        self.visit_FunctionDef(node)
