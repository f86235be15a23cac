"""Resolves names of a module to what they import: `njit` to `numba.njit`, also under another name."""

import ast
from collections.abc import Mapping

_PARTIAL = "functools.partial"


class ImportedNames:
    """The imports of a module, and its own names for imported functions (`fast = njit(cache=True)`)."""

    def __init__(self, module: ast.Module, path: str) -> None:
        self._dotted_by_name: dict[str, str] = dict(_imports(module, path))
        for node in module.body:
            match node:
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    if name not in self._dotted_by_name and (dotted := self.dotted_callable(value)):
                        self._dotted_by_name[name] = dotted

    @property
    def dotted_by_name(self) -> Mapping[str, str]:
        return self._dotted_by_name

    def dotted(self, node: ast.expr) -> str:
        """Return the dotted name that an expression imports; empty if it is no imported name."""
        match node:
            case ast.Name(id=name):
                return self._dotted_by_name.get(name, "")
            case ast.Attribute(value=value, attr=name):
                return f"{owner}.{name}" if (owner := self.dotted(value)) else ""
        return ""

    def dotted_callable(self, node: ast.expr) -> str:
        """Like `dotted`, also for a call that sets options: `njit(cache=True)`, `partial(jit, ...)`."""
        if isinstance(node, ast.Call):
            name = self.dotted_callable(node.func)
            return self.dotted_callable(node.args[0]) if name == _PARTIAL and node.args else name
        return self.dotted(node)


def _imports(module: ast.Module, path: str) -> list[tuple[str, str]]:
    """Return local and dotted name of each import, also those in functions and `try` blocks."""
    names = []
    for node in ast.walk(module):
        match node:
            case ast.Import(names=aliases):
                for alias in aliases:
                    first = alias.name.partition(".")[0]
                    names.append((alias.asname, alias.name) if alias.asname else (first, first))
            case ast.ImportFrom(module=source, names=aliases, level=level):
                package = ".".join(path.split("/")[:-level]) if level else ""
                origin = ".".join(filter(None, (package, source)))
                names += [(alias.asname or alias.name, f"{origin}.{alias.name}") for alias in aliases]
    return names
