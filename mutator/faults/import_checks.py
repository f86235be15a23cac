"""Check the names that an injected statement imports: the target must define them."""

import ast
from collections.abc import Iterator
from pathlib import Path

from mutator._common.message_text import describe_choices, spelling_suggestion
from mutator.errors import MutatorError
from mutator.targets.manifest import TargetManifest


def check_import_defined(manifest: TargetManifest, dotted_name: str) -> None:
    """Raise MutatorError unless `dotted_name` names something that a module of the target defines.

    The caller adds file and line to the error.
    """
    module, _, name = dotted_name.rpartition(".")
    base = module.replace(".", "/")
    path = next((p for p in (f"{base}.py", f"{base}/__init__.py") if p in manifest.tree.files), None)
    if path is None:
        raise MutatorError(
            f"no module '{module}' in target {manifest.name}",
            expected="a module of the target and a name in it, such as package.module.Name",
            remedy=f"correct the name, or the `files` of {manifest.path.name}",
        )
    names = manifest.tree.derive_once(path, _sorted_top_level_names)
    if name not in names:
        public = [x for x in names if not x.startswith("_")]
        raise MutatorError(
            f"'{name}' is not defined in {path}",
            expected=describe_choices(public),
            remedy="correct the name" + spelling_suggestion(name, public),
        )


def _sorted_top_level_names(path: str, data: bytes, root: Path) -> list[str]:
    try:
        return sorted(_top_level_names(ast.parse(data)))
    except (SyntaxError, ValueError, RecursionError) as error:
        message, line = (error.msg, error.lineno) if isinstance(error, SyntaxError) else (str(error), None)
        raise MutatorError(
            f"not valid Python: {message}",
            where=root / path,
            line=line,
            remedy="correct the target's source, or use the Python that it is written for",
        ) from None


def _top_level_names(module: ast.Module) -> Iterator[str]:
    for node in module.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            yield node.name
        elif isinstance(node, ast.Import | ast.ImportFrom) and getattr(node, "module", "") != "__future__":
            yield from (alias.asname or alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.Assign):
            yield from (target.id for target in node.targets if isinstance(target, ast.Name))
