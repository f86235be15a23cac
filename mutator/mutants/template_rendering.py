"""Renders a fault model's template with parameters as lines of Python.

Templates use a small part of Jinja2, in its sandbox (`template_language`); an undefined name is an error.
Every printed value is a Python literal or a checked name, so it cannot become other code.
"""

import ast
import io
import math
import re
import tokenize
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NoReturn

from jinja2 import TemplateError, TemplateSyntaxError, Undefined

from mutator.config import units
from mutator.config.location_syntax import PROBE_MODULE_NAME, is_assignable, is_dotted_name
from mutator.errors import MutatorError
from mutator.faults.fault_models import NAME_PARAM_TYPES, FaultModel, ParamSchema, SnippetKind
from mutator.model import Value
from mutator.mutants.normalized_source import normalize_numbers_and_ids
from mutator.mutants.restricted_template_language import TemplateEnvironment

_MOST_INTEGER_EXACT_AS_FLOAT = 2.0**53  # every integer up to this is exact as a double
_EXPECTED_BY_PARAM_TYPE = {  # by parameter type
    "variable": "the name of a variable",
    "import": "a dotted name to import",
    "integer": "an integer",
}
_ARGUMENT_PATTERN = re.compile(r"(?P<keyword>\w+=)?(?P<value>.*)", re.DOTALL)  # as `ast.unparse` writes it


def python_literal(value: object) -> str:
    """Return a value as Python source. Numbers keep their exact value; names are unchanged."""
    if value is None or isinstance(value, bool):
        return repr(value)
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else f"float('{value}')"
    if isinstance(value, int):
        return repr(value)
    if isinstance(value, str | Undefined):
        return str(value)  # an undefined name raises UndefinedError
    raise MutatorError(f"a {type(value).__name__} in a template", expected="a number or a name")


def signed_term(value: int | float) -> str:
    """Return a term to add in an expression: `+ 3` or `- 2.5`.

    A whole number is written without a point, so that an integer stays an integer.
    """
    negative = math.copysign(1.0, value) < 0.0 and not math.isnan(value)
    size = -value if negative else value
    whole = isinstance(size, float) and size <= _MOST_INTEGER_EXACT_AS_FLOAT and size.is_integer()
    return f"{'-' if negative else '+'} {python_literal(int(size) if whole else size)}"


def exchange_arguments(arguments: Sequence[str], first: int, second: int) -> list[str]:
    """Exchange the values of two arguments of a call, counted from 1; keywords stay in place."""
    parts = [_ARGUMENT_PATTERN.fullmatch(text) for text in arguments]
    for number in (first, second):
        part = parts[number - 1] if 0 < number <= len(parts) else None
        if part is None or first == second or part["value"].startswith("*"):
            raise MutatorError(
                f"arguments {first} and {second} of ({', '.join(arguments)}) cannot be exchanged",
                expected="two different arguments, counted from 1, without stars",
                remedy="correct the numbers",
            )
    values = [part["value"] for part in parts if part]
    values[first - 1], values[second - 1] = values[second - 1], values[first - 1]
    return [(part["keyword"] or "") + value for part, value in zip(parts, values, strict=True) if part]


def unit_mixup_factor(written: str, read: str) -> float:
    """Return the factor by which a quantity changes if it is written in one unit and read in another."""
    written_unit, read_unit = units.UNITS[written], units.UNITS[read]
    if written_unit.dimension != read_unit.dimension or written_unit == read_unit:
        raise MutatorError(
            f"written in {written}, read as {read}",
            expected=f"two different units of {written_unit.dimension}",
            remedy="correct one of them",
        )
    return units.convert_unit(1.0, read_unit, written_unit)


def refuse_params(why: str) -> NoReturn:
    """Reject a combination of parameters; called from templates."""
    raise MutatorError(why, remedy="correct the parameters, or anchor elsewhere")


def join_literals(items: Sequence[object], between: str = "") -> str:
    """Join names, texts and numbers."""
    return between.join(map(python_literal, items))


_TEMPLATE_ENVIRONMENT = TemplateEnvironment(
    functions={"refuse": refuse_params},
    filters={
        "signed": signed_term,
        "exchanged": exchange_arguments,
        "taken_for": unit_mixup_factor,
        "join": join_literals,
    },
    finalize=python_literal,
)
_PARSER_ERRORS = (SyntaxError, ValueError, RecursionError, MemoryError)  # what Python's parser raises
# what a template's own arithmetic, indices and methods can raise
_RENDERING_ERRORS = (
    TypeError,
    ValueError,
    ArithmeticError,
    AttributeError,
    LookupError,
    RecursionError,
    MemoryError,
)


def render_snippet(
    model: FaultModel,
    params: Mapping[str, Value],
    injection_id: str,
    statements: Mapping[str, str] | None = None,
) -> tuple[str, ...]:
    """Return the model's lines for these parameters, untagged, indented by 4 spaces a level.

    `fi` is the injection's id; `statements` are the source texts that the model needs. MutatorError if the
    template fails or its result does not consist of whole lines of Python.
    """
    if model.kind is SnippetKind.VALUE:
        target = str(_checked_param(next(param for param in model.params if param.name == "target"), params))
        return (
            f'if {PROBE_MODULE_NAME}.active("{injection_id}"):',
            f"    {target} = {render_changed_value(model, params, injection_id, target)}",
        )
    names = {param.name: _checked_param(param, params) for param in model.params}
    text = render_template(
        model.template, {"fi": injection_id, **names, **(statements or {})}, model.template_path
    )
    text = text.removesuffix("\n")
    if not _is_valid_snippet(normalize_numbers_and_ids(text, (injection_id,)), model.kind):
        _check_snippet(text, model.kind, model.template_path)
    return tuple(text.split("\n"))


def render_changed_value(
    model: FaultModel,
    params: Mapping[str, Value],
    injection_id: str,
    original: str,
    parts: Mapping[str, object] | None = None,
) -> str:
    """Return the model's expression for the changed value of `original`, which is source on one line.

    `parts` are the components of `original`. MutatorError if the model cannot change values, or if the
    template fails or does not render one expression.
    """
    if model.expression_template is None:
        raise MutatorError(
            f"model {model.name} cannot change the value of an expression",
            where=model.source.path,
            expected="a model of kind `value`, or one with an `expression`",
            remedy="anchor at a statement, or use another model",
        )
    names: dict[str, object] = {
        param.name: _checked_param(param, params) for param in model.params if param.name != "target"
    }
    names |= {"fi": injection_id, "original": original, **(parts or {})}
    text = render_template(model.expression_template, names, model.template_path)
    plain = normalize_numbers_and_ids(text, (injection_id,))
    if not _is_expression(plain):
        raise MutatorError(
            f"the template gives {text!r}",
            where=model.template_path,
            expected="one expression on one line, no comment, no `yield`",
            remedy="correct the template, or anchor at an expression that does not yield",
        )
    return text if _binds_tighter_than_if(plain) else f"({text})"


@lru_cache(maxsize=1024)
def _is_expression(text: str) -> bool:
    """Return whether normalized source, and all source that it covers, is an expression without `yield`."""
    try:
        tree = ast.parse(text, mode="eval")
        ast.parse(f"({text})", mode="eval")  # a comment would hide the bracket
    except _PARSER_ERRORS:
        return False
    return "\n" not in text and not any(isinstance(n, ast.Yield | ast.YieldFrom) for n in ast.walk(tree))


@lru_cache(maxsize=1024)
def _binds_tighter_than_if(text: str) -> bool:
    """Return whether an expression binds tighter than a following `if`. A tuple or lambda does not."""
    whole = ast.parse(f"{text} if 0 else 0", mode="eval").body
    return isinstance(whole, ast.IfExp) and ast.dump(whole.body) == ast.dump(
        ast.parse(text, mode="eval").body
    )


def _checked_param(param: ParamSchema, params: Mapping[str, Value]) -> Value:
    """Return the value that the template gets for this parameter; MutatorError if its type is wrong.

    A constant that is not a number is passed as Python source, so that None differs from a missing value.
    """
    value = params.get(param.name)
    if param.type == "constant":
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return value if number or param.name not in params else repr(value)
    if param.type == "expression" or (value is None and param.optional and param.type == "variable"):
        return value  # an expression is checked when its spec is expanded
    words = {"choice": param.choices, "unit": units.UNITS}.get(param.type)
    if words is not None:
        if value not in words and not (value is None and param.optional):
            raise MutatorError(f"{value!r} for '{param.name}'", expected=f"one of {', '.join(words)}")
        return value
    fits = is_assignable if param.type == "variable" else is_dotted_name
    is_name = isinstance(value, str) and fits(value)
    if is_name != (param.type in NAME_PARAM_TYPES) or (isinstance(value, str) and not is_name):
        raise MutatorError(
            f"{value!r} for '{param.name}'",
            expected=_EXPECTED_BY_PARAM_TYPE.get(param.type, f"a {param.type}"),
        )
    return value


def render_template(template: str, names: Mapping[str, object], where: Path, first_line: int = 1) -> str:
    """Render a template, or its part from `first_line` on; MutatorError with the line, if known."""
    try:
        return _TEMPLATE_ENVIRONMENT.compiled_template(template).render(names)
    except TemplateSyntaxError as error:
        raise _template_error(str(error.message), where, error.lineno, first_line) from None
    except TemplateError as error:
        raise _template_error(
            str(error.message or error), where, _template_line_of(error), first_line
        ) from None
    except _RENDERING_ERRORS as error:
        raise _template_error(
            f"{type(error).__name__}: {error}", where, _template_line_of(error), first_line
        ) from None


def _template_error(problem: str, where: Path, line: int | None, first_line: int) -> MutatorError:
    return MutatorError(
        f"the template fails: {problem}",
        where=where,
        line=line + first_line - 1 if line else None,
        expected="names of the model's parameters, `fi`, a loop over a list, a condition, arithmetic, or one "
        f"of the filters {', '.join(sorted(_TEMPLATE_ENVIRONMENT.filter_names))}",
        remedy="correct the template, or let the code that it writes do the work",
    )


def _template_line_of(error: BaseException) -> int | None:
    """Return the template's line in a traceback. Jinja2 maps its frames back to template lines."""
    line = None
    trace = error.__traceback__
    while trace:
        if trace.tb_frame.f_code.co_filename == "<template>":
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


@lru_cache(maxsize=1024)
def _is_valid_snippet(text: str, kind: SnippetKind) -> bool:
    """Return whether normalized source, and so all source that it covers, passes `_check_snippet`."""
    try:
        _check_snippet(text, kind, Path())
    except MutatorError:
        return False
    return True


def _check_snippet(text: str, kind: SnippetKind, where: Path) -> None:
    """Check that every line ends a statement or opens a block, so that each can carry its tag."""
    text += "\n"
    whole = text + "    pass\n" if kind is SnippetKind.GUARD else text
    try:
        tree = ast.parse(whole)
        ends = [
            token.start[0]
            for token in tokenize.generate_tokens(io.StringIO(text).readline)
            if token.type == tokenize.NEWLINE
        ]
    except (*_PARSER_ERRORS, tokenize.TokenError) as error:
        problem = str(error.args[0]) if error.args else "too many nested operations"
        if isinstance(error, SyntaxError) and kind is SnippetKind.GUARD:
            problem = f"{error.msg} (a guard's last line must open a block)"
        raise MutatorError(
            f"the template does not give valid Python: {problem}: {text!r}",
            where=where,
            remedy="correct the template",
        ) from None
    lines = text.split("\n")[:-1]
    if any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(tree)):
        raise MutatorError(
            f"the template contains `yield`: {text!r}",
            where=where,
            expected="lines without `yield`, which would turn the function into a generator",
            remedy="correct the template",
        )
    uneven = any((len(x) - len(x.lstrip(" "))) % 4 or "\t" in x for x in lines)
    if uneven or ends != list(range(1, len(lines) + 1)):
        raise MutatorError(
            f"the template gives {text!r}",
            where=where,
            expected="one statement a line, 4 spaces a level, no blank lines, no comments, no tabs",
            remedy="correct the template",
        )
