"""Models of defences, `templates/defences/<model>.py`: small Python files that are copied into a tree.

A model is a class `Model` with `__init__`, which takes numbers by keyword, `reset` and `update`.
"""

import ast
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_path_inside
from mutator._common.message_text import describe_choices, spelling_suggestion
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError

MODELS_FOLDER = "defences"
_MOST_MODEL_BYTES = 100_000
# a defence has no clock, file, process or shared random state
_ALLOWED_IMPORTS = frozenset(
    ("bisect", "cmath", "collections", "dataclasses", "enum", "fractions", "functools", "heapq", "itertools")
) | frozenset(("math", "numbers", "operator", "statistics", "typing"))
_REFUSED_NAMES = frozenset(("__import__", "compile", "eval", "exec", "globals", "input", "open", "print"))
_NO_ARGUMENTS = ast.arguments(
    posonlyargs=[], args=[ast.arg("self")], kwonlyargs=[], kw_defaults=[], defaults=[]
)
_METHODS = {"reset": ("self",), "update": ("self", "since_s", "sensed", "applied")}


@dataclass(frozen=True, slots=True, kw_only=True)
class DefenceModelFile:
    """A model's file: the numbers that it takes, those that it needs, and whether it takes others, too.

    The names of those others are `<word>_<command>`, with a word of `bounds`; None: any word.
    """

    path: Path
    code: bytes
    parameters: tuple[str, ...]
    required_parameters: tuple[str, ...]
    takes_any: bool
    bounds: tuple[str, ...] | None

    def choose_parameters(
        self, names: Sequence[str], commands: Collection[str], source: YamlSource
    ) -> tuple[str, ...]:
        """Return which of a defence's parameters the model gets; MutatorError if one is missing."""
        for name in self.required_parameters:
            if name not in names:
                raise source.error(
                    ("parameters",),
                    f"no parameter '{name}'",
                    expected=f"the parameters of model {self.path.stem}: {', '.join(self.parameters)}",
                    remedy="add it, with its unit",
                )
        return tuple(name for name in names if name in self.parameters or self._is_bound(name, commands))

    def _is_bound(self, name: str, commands: Collection[str]) -> bool:
        if not self.takes_any:
            return False
        if self.bounds is None:
            return name.endswith(tuple(f"_{command}" for command in commands))
        return name in (f"{word}_{command}" for word in self.bounds for command in commands)

    def describe_parameters(self, commands: Sequence[str]) -> str:
        """Return which parameters the model takes, as text."""
        names = list(self.parameters)
        if self.takes_any:
            names += [f"{word}_{command}" for word in self.bounds or ("...",) for command in commands]
        return ", ".join(names) or "none"


def load_defence_model(templates: Path, name: str, source: YamlSource) -> DefenceModelFile:
    """Read and check the model that a defence names. MutatorError for an unknown name, for a file that is no
    model, and for imports other than a few of the standard library.
    """
    folder = templates / MODELS_FOLDER
    names = sorted(path.stem for path in folder.glob("*.py"))
    if name not in names:
        raise source.error(
            ("model",),
            f"'{name}'",
            expected=f"{describe_choices(names)}, a file in {folder}" if names else f"a file in {folder}",
            remedy="correct the name" + spelling_suggestion(name, names),
        )
    path = checked_path_inside(templates, folder / f"{name}.py")
    code = read_bounded(path, _MOST_MODEL_BYTES)
    try:
        tree = ast.parse(code)
        compile(code, str(path), "exec", dont_inherit=True)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise MutatorError(
            f"not valid Python: {error.args[0] if error.args else 'nested too deeply'}",
            where=path,
            line=error.lineno if isinstance(error, SyntaxError) else None,
            remedy="correct the model",
        ) from None
    _check_uses(tree, path)
    arguments = _init_arguments(tree, path)
    return DefenceModelFile(
        path=path,
        code=code,
        parameters=tuple(argument.arg for argument in arguments.kwonlyargs),
        required_parameters=tuple(
            argument.arg
            for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
            if default is None
        ),
        takes_any=arguments.kwarg is not None,
        bounds=_bounds(tree, path),
    )


def _bounds(tree: ast.Module, path: Path) -> tuple[str, ...] | None:
    """Return a model's `BOUNDS`, the first words of parameters that it takes without naming them."""
    for node in tree.body:
        match node:
            case (
                ast.Assign(targets=[ast.Name(id="BOUNDS")], value=ast.expr() as value)
                | ast.AnnAssign(target=ast.Name(id="BOUNDS"), value=ast.expr() as value)
            ):
                items = value.elts if isinstance(value, ast.Tuple) else []
                words = [item.value for item in items if isinstance(item, ast.Constant)]
                names = tuple(word for word in words if isinstance(word, str) and word.isidentifier())
                if names and len(names) == len(items):
                    return names
                expected = 'first words of parameters, e.g. ("lowest", "highest")'
                raise _model_error(f"BOUNDS = {ast.unparse(value)}", path, node.lineno, expected)
    return None


def _check_uses(tree: ast.Module, path: Path) -> None:
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=aliases):
                imports = [alias.name for alias in aliases]
            case ast.ImportFrom(module=module, level=level):
                imports = ["." * level + (module or "")]
            case ast.Name(id=name) if name in _REFUSED_NAMES:
                raise _model_error(f"the name `{name}`", path, node.lineno, "neither files nor other code")
            case _:
                continue
        for name in imports:
            if name.split(".")[0] not in _ALLOWED_IMPORTS:
                expected = f"imports of {', '.join(sorted(_ALLOWED_IMPORTS))}"
                raise _model_error(f"an import of {name}", path, node.lineno, expected)


def _init_arguments(tree: ast.Module, path: Path) -> ast.arguments:
    """Check the class `Model`, and return the arguments of its `__init__`."""
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "Model"]
    if len(classes) != 1:
        raise _model_error(f"{len(classes)} classes `Model`", path, None, "one")
    methods = {node.name: node.args for node in classes[0].body if isinstance(node, ast.FunctionDef)}
    for name, expected in _METHODS.items():
        arguments = methods.get(name)
        if arguments is None or tuple(argument.arg for argument in arguments.args) != expected:
            raise _model_error(
                f"no method `{name}({', '.join(expected)})`",
                path,
                classes[0].lineno,
                "it, with these arguments",
            )
    initial = methods.get("__init__") or _NO_ARGUMENTS
    if len(initial.args) != 1 or initial.posonlyargs or initial.vararg:
        raise _model_error(
            "arguments by position in `Model.__init__`",
            path,
            classes[0].lineno,
            "`self, *`, then its numbers",
        )
    return initial


def _model_error(problem: str, path: Path, line: int | None, expected: str) -> MutatorError:
    return MutatorError(problem, where=path, line=line, expected=expected, remedy="correct the model")
