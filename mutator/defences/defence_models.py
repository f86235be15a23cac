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
from mutator.defences.model_reads import Reads, commands_of, reads_of
from mutator.defences.model_uses import check_uses, model_error
from mutator.errors import MutatorError

MODELS_FOLDER = "defences"
_MOST_MODEL_BYTES = 100_000
_NO_ARGUMENTS = ast.arguments(
    posonlyargs=[], args=[ast.arg("self")], kwonlyargs=[], kw_defaults=[], defaults=[]
)
_METHODS = {"reset": ("self",), "update": ("self", "since_s", "sensed", "applied")}


@dataclass(frozen=True, slots=True, kw_only=True)
class DefenceModelFile:
    """A model's file: the numbers that it takes, those that it needs, and whether it takes others, too.

    The names of those others are `<word>_<command>`, with a word of `bounds`; None: any word. `sensed` and
    `applied` say what the model reads from these arguments, and `commands` for which commands it always
    gives ranges, as far as its source says so.
    """

    path: Path
    code: bytes
    parameters: tuple[str, ...]
    required_parameters: tuple[str, ...]
    takes_any: bool
    bounds: tuple[str, ...] | None
    sensed: Reads
    applied: Reads
    commands: tuple[str, ...]

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
    """Read and check the model that a defence names. MutatorError if the name is unknown, if the file cannot
    be read or is no model, or if it uses what `check_uses` refuses.
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
    code = _read_model(path, source)
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
    check_uses(tree, path)
    methods = _methods(tree, path)
    arguments = methods["__init__"].args if "__init__" in methods else _NO_ARGUMENTS
    required = [
        argument.arg
        for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
        if default is None
    ]
    if arguments.kwarg:
        required += dict(reads_of(methods["__init__"], arguments.kwarg.arg).line_by_required_name)
    return DefenceModelFile(
        path=path,
        code=code,
        parameters=tuple(argument.arg for argument in arguments.kwonlyargs),
        required_parameters=tuple(required),
        takes_any=arguments.kwarg is not None,
        bounds=_bounds(tree, path),
        sensed=reads_of(methods["update"], "sensed"),
        applied=reads_of(methods["update"], "applied"),
        commands=commands_of(methods["update"]),
    )


def _read_model(path: Path, source: YamlSource) -> bytes:
    try:
        return read_bounded(path, _MOST_MODEL_BYTES)
    except OSError as error:
        raise source.error(
            ("model",),
            f"{path} cannot be read ({error.strerror})",
            expected="a file, the source of a model",
            remedy="put a file in its place, or name another model",
        ) from None


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
                raise model_error(f"BOUNDS = {ast.unparse(value)}", path, node.lineno, expected)
    return None


def _methods(tree: ast.Module, path: Path) -> dict[str, ast.FunctionDef]:
    """Check the class `Model`, and return its methods by name."""
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "Model"]
    if len(classes) != 1:
        raise model_error(f"{len(classes)} classes `Model`", path, 1, "one")
    line = classes[0].lineno
    methods = {node.name: node for node in classes[0].body if isinstance(node, ast.FunctionDef)}
    for name, expected in _METHODS.items():
        method = methods.get(name)
        if method is None or tuple(argument.arg for argument in method.args.args) != expected:
            problem = f"no method `{name}({', '.join(expected)})`"
            raise model_error(problem, path, line, "it, with these arguments")
    if "__init__" in methods:
        initial = methods["__init__"].args
        if len(initial.args) != 1 or initial.posonlyargs or initial.vararg:
            problem = "arguments by position in `Model.__init__`"
            raise model_error(problem, path, line, "`self, *`, then its numbers")
    return methods
