"""Guesses from names, state and calls which functions are steps of the control loop."""

import ast
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from mutator.mutants.expression_roles import FORMATTED_STRING_NODES
from mutator.onboarding.source_survey import SourceModule, SourceSurvey

Function = ast.FunctionDef | ast.AsyncFunctionDef

_STEP_WORDS_BY_SCORE = {  # names of step functions; a higher number is more certain
    6: "step update control compute_control run_step",
    5: "act compute compute_command drive get_control",
    4: "__call__ tick calculate decide iterate acceleration steering",
    3: "plan sense solve track",
    2: "apply forward predict process run",
}
_SCORE_BY_STEP_WORD = {word: score for score, words in _STEP_WORDS_BY_SCORE.items() for word in words.split()}
_CONTROLLER_PATTERN = re.compile("control|pid|pilot|planner|agent|driver|regulator|tracker|cruise|mpc")
_NON_CONTROLLER_PATTERN = re.compile("env|sim|plant|world|render|viewer|logger|graphics|mixin|wrapper|test")
_MOST_STATE_POINTS = _MOST_VALUE_POINTS = 6  # further attributes or values do not add points
_CONTROLLER_FILE_POINTS = 3  # points if the file name suggests a controller
_NO_HINT_POINTS = -6  # points if neither the name nor calls suggest a step
_NUMBER_FUNCTION_PATTERN = re.compile(
    "abs|min|max|float|int|round|clip|interp|hypot|sum|dot|norm"
)  # these return numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueCandidate:
    """A name to which a number is assigned."""

    name: str
    line: int
    nth: int | None  # number of this assignment to the name in the function; None: it is the only one
    score: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCandidate:
    """A function that might be the step of a loop, and the values that it computes, likeliest first."""

    module: str
    path: str
    line: int
    class_name: str | None  # the class of a method
    function: str
    is_async: bool
    required_arguments: tuple[str, ...]  # required arguments
    constructor_arguments: tuple[str, ...]  # required arguments of the class's constructor
    score: int
    loop_call_count: int  # how many loops of the tree call a function of this name
    values: tuple[ValueCandidate, ...]

    @property
    def likelihood(self) -> tuple[int, int, int, int]:
        """Higher is likelier: the score, then what distinguishes functions of equal scores."""
        value_scores = [value.score for value in self.values]
        return self.score, self.loop_call_count, sum(value_scores), len(value_scores)

    @property
    def name(self) -> str:
        """The name in a fault spec: `PID.update`."""
        return f"{self.class_name}.{self.function}" if self.class_name else self.function


def list_step_candidates(survey: SourceSurvey) -> tuple[StepCandidate, ...]:
    """Return public functions that might be the step of a loop, likeliest first.

    The order of files decides only between functions that nothing distinguishes.
    """
    loop_call_counts = Counter(
        name for module in survey.modules for name in _names_called_in_loops(module.tree)
    )
    candidates = [
        candidate
        for module in survey.modules
        for candidate in _candidates_in_module(module, loop_call_counts)
    ]
    candidates.sort(key=lambda candidate: (candidate.path, candidate.line))
    return tuple(sorted(candidates, key=lambda candidate: candidate.likelihood, reverse=True))


def group_by_function_name(candidates: Iterable[StepCandidate]) -> list[list[StepCandidate]]:
    """Group functions and methods of one name, such as the `update` of many controllers, in their order."""
    groups: dict[str, list[StepCandidate]] = {}
    for candidate in candidates:
        groups.setdefault(candidate.function, []).append(candidate)
    return list(groups.values())


def _candidates_in_module(module: SourceModule, loop_call_counts: Counter[str]) -> Iterator[StepCandidate]:
    for node in module.tree.body:
        if isinstance(node, ast.ClassDef):
            for function in node.body:
                if isinstance(function, Function) and _can_be_step(function):
                    yield _build_candidate(module, node, function, loop_call_counts)
        elif isinstance(node, Function) and _can_be_step(node):
            yield _build_candidate(module, None, node, loop_call_counts)


def _can_be_step(function: Function) -> bool:
    if isinstance(function, ast.AsyncFunctionDef) and _is_generator(function):
        return False
    if function.name.startswith("_") and function.name not in _SCORE_BY_STEP_WORD:
        return False
    hidden = {"property", "classmethod", "abstractmethod", "overload"}
    if any(
        (isinstance(d, ast.Name) and d.id in hidden) or isinstance(d, ast.Attribute)
        for d in function.decorator_list
    ):
        return False
    body = [node for node in function.body if not isinstance(node, ast.Expr | ast.Pass | ast.Raise)]
    return bool(body)


def _is_generator(function: Function) -> bool:
    return any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(function))


def _build_candidate(
    module: SourceModule, class_node: ast.ClassDef | None, function: Function, loop_call_counts: Counter[str]
) -> StepCandidate:
    values = tuple(_value_candidates(function))
    # three calls in loops say as much as thirty, which only a helper has
    hints = _name_score(function.name) + 2 * min(loop_call_counts[function.name], 3)
    score = min(len(values), _MOST_VALUE_POINTS) + (hints or _NO_HINT_POINTS)
    if class_node is not None:
        score += min(len(_state_attributes(class_node)), _MOST_STATE_POINTS) + _class_score(class_node.name)
    score += _CONTROLLER_FILE_POINTS * bool(_CONTROLLER_PATTERN.search(module.path.lower()))
    init = (
        next((n for n in class_node.body if isinstance(n, Function) and n.name == "__init__"), None)
        if class_node
        else None
    )
    return StepCandidate(
        module=module.name,
        path=module.path,
        line=function.lineno,
        class_name=class_node.name if class_node else None,
        function=function.name,
        is_async=isinstance(function, ast.AsyncFunctionDef),
        loop_call_count=loop_call_counts[function.name],
        required_arguments=_required_arguments(function, is_method=class_node is not None),
        constructor_arguments=_required_arguments(init, is_method=True) if init else (),
        score=score,
        values=values,
    )


def _name_score(name: str) -> int:
    if name in _SCORE_BY_STEP_WORD:
        return _SCORE_BY_STEP_WORD[name]
    return max(
        (score - 2 for word, score in _SCORE_BY_STEP_WORD.items() if word in name.split("_")), default=0
    )


def _class_score(name: str) -> int:
    lower = name.lower()
    # a `ControllerEnv` is a world, so a word of the world counts more
    return 5 * bool(_CONTROLLER_PATTERN.search(lower)) - 6 * bool(_NON_CONTROLLER_PATTERN.search(lower))


def _required_arguments(function: Function, *, is_method: bool) -> tuple[str, ...]:
    arguments = function.args
    positional = [*arguments.posonlyargs, *arguments.args]
    positional = positional[: len(positional) - len(arguments.defaults)]
    static = any(isinstance(d, ast.Name) and d.id == "staticmethod" for d in function.decorator_list)
    keyword = [
        a for a, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True) if default is None
    ]
    return tuple(argument.arg for argument in (*positional[is_method and not static :], *keyword))


def _state_attributes(class_node: ast.ClassDef) -> set[str]:
    return {
        target.attr
        for node in ast.walk(class_node)
        for target in _assignment_targets(node)
        if isinstance(target, ast.Attribute)
        and isinstance(target.value, ast.Name)
        and target.value.id == "self"
    }


def _assignment_targets(node: ast.AST) -> Iterable[ast.expr]:
    if isinstance(node, ast.Assign):
        return node.targets
    return (node.target,) if isinstance(node, ast.AugAssign | ast.AnnAssign) else ()


def _names_called_in_loops(tree: ast.Module) -> Iterator[str]:
    for loop in ast.walk(tree):
        if isinstance(loop, ast.For | ast.While):
            for node in ast.walk(loop):
                if isinstance(node, ast.Call):
                    called = node.func
                    yield called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")


def _value_candidates(function: Function) -> Iterator[ValueCandidate]:
    """Yield the names to which a function assigns numbers, likeliest first."""
    assigned = [
        (node, target) for node in _statements_in(function.body) for target in _assignment_targets(node)
    ]
    names = [ast.unparse(target) for _, target in assigned]
    candidates = []
    for i, ((node, _), name) in enumerate(zip(assigned, names, strict=True)):
        likely = _number_score(getattr(node, "value", None))
        plain = all(part.isidentifier() for part in name.split("."))
        if not plain or name.startswith("_") or likely == 0:
            continue
        times = names.count(name)
        nth = names[: i + 1].count(name) if times > 1 else None
        candidates.append(ValueCandidate(name=name, line=node.lineno, nth=nth, score=likely - (times > 1)))
    yield from sorted(candidates, key=lambda candidate: (-candidate.score, candidate.line))


def _statements_in(body: Iterable[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements in order, without those of nested functions and classes."""
    for node in body:
        yield node
        if isinstance(node, Function | ast.ClassDef):
            continue
        for name in ("body", "orelse", "finalbody"):
            yield from _statements_in(getattr(node, name, ()))
        for part in (*getattr(node, "handlers", ()), *getattr(node, "cases", ())):
            yield from _statements_in(part.body)


def _number_score(value: ast.expr | None) -> int:
    """Score how likely an expression is to be a computed number; 0: impossible."""
    if isinstance(value, ast.BinOp):
        return (
            0
            if any(isinstance(n, FORMATTED_STRING_NODES) or _is_text_constant(n) for n in ast.walk(value))
            else 4
        )
    if isinstance(value, ast.UnaryOp):
        return _number_score(value.operand) if not isinstance(value.op, ast.Not) else 0
    if isinstance(value, ast.Call):
        called = value.func.attr if isinstance(value.func, ast.Attribute) else getattr(value.func, "id", "")
        return 3 if _NUMBER_FUNCTION_PATTERN.fullmatch(called) else 2
    if isinstance(value, ast.IfExp):
        return min(_number_score(value.body), _number_score(value.orelse))
    if isinstance(value, ast.Name | ast.Attribute | ast.Subscript):
        return 1
    return int(isinstance(value, ast.Constant) and type(value.value) in (int, float))


def _is_text_constant(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
