"""Names that an injected statement imports: they must be there, in the target and nowhere else."""

import ast
from collections.abc import Iterator

from mutator._common.text import suggestion
from mutator.errors import MutatorError
from mutator.targets.manifest import TargetManifest


def check_import(manifest: TargetManifest, dotted: str) -> None:
    """MutatorError (without place) unless `dotted` is a module of the target and a name defined in it."""
    module, _, name = dotted.rpartition(".")
    base = module.replace(".", "/")
    path = next((p for p in (f"{base}.py", f"{base}/__init__.py") if p in manifest.tree.files), None)
    if path is None:
        raise MutatorError(
            f"no module '{module}' in target {manifest.name}",
            expected="a module of the target and a name in it, such as package.module.Name",
            remedy=f"correct the name, or the `files` of {manifest.path.name}",
        )
    known = sorted(_defined(ast.parse(manifest.tree.parsed(path).data)))
    if name not in known:
        public = [x for x in known if not x.startswith("_")]
        raise MutatorError(
            f"'{name}' is not defined in {path}",
            expected=f"one of {', '.join(public) or 'none'}",
            remedy="correct the name" + suggestion(name, public),
        )


def _defined(module: ast.Module) -> Iterator[str]:
    """Names that a module's top level defines or imports."""
    for node in module.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            yield node.name
        elif isinstance(node, ast.Import | ast.ImportFrom) and getattr(node, "module", "") != "__future__":
            yield from (alias.asname or alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.Assign):
            yield from (target.id for target in node.targets if isinstance(target, ast.Name))
