"""The part of Jinja2 that templates can use, so that each renders quickly and within little memory.

A template writes code and computes almost nothing. Constructs that repeat or multiply text are rejected
before the template is compiled. For the rest, `Context` counts loop turns and processed characters.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache, wraps
from typing import Any

from jinja2 import StrictUndefined, Template, TemplateSyntaxError, nodes, pass_context
from jinja2.exceptions import SecurityError
from jinja2.runtime import Context as _Context
from jinja2.sandbox import ImmutableSandboxedEnvironment

MOST_TEMPLATE_OR_RESULT_CHARACTERS = 50_000  # of a template, and of its result
MOST_TEMPLATE_NODES = 1000  # names, constants, operators, tags and pieces of text
MOST_NESTED_NODES = 30  # nodes in nodes
MOST_WORK_STEPS = 200_000  # loop turns times the nodes in the loop, and characters that are processed
_MOST_NUMBER_BITS = 2048  # bits
_ALLOWED_NODES = (
    nodes.Template,
    nodes.Output,
    nodes.TemplateData,
    nodes.Const,
    nodes.Name,
    nodes.If,
    nodes.For,
    nodes.Assign,
    nodes.CondExpr,
    nodes.Compare,
    nodes.Operand,
    nodes.And,
    nodes.Or,
    nodes.Not,
    nodes.Neg,
    nodes.Pos,
    nodes.Add,
    nodes.Sub,
    nodes.Mul,
    nodes.Div,
    nodes.FloorDiv,
    nodes.Mod,
    nodes.Getattr,
    nodes.Getitem,
    nodes.Slice,
    nodes.Call,
    nodes.Filter,
    nodes.Test,
    nodes.Tuple,
    nodes.List,
)
# none returns more text than it gets; `join`, `replace` and `format` could multiply it
_ALLOWED_METHODS = (
    "endswith",
    "partition",
    "removeprefix",
    "removesuffix",
    "rpartition",
    "split",
    "startswith",
    "strip",
)
_ALLOWED_TESTS = (
    "boolean",
    "defined",
    "even",
    "false",
    "float",
    "in",
    "integer",
    "none",
    "number",
    "odd",
    "string",
    "true",
)
_ALLOWED_LOOP_ATTRIBUTES = (
    "first",
    "index",
    "index0",
    "last",
    "length",
    "revindex",
    "revindex0",
)  # attributes of `loop`
_JINJA_FILTERS = ("abs", "default", "float", "int", "length")  # of Jinja2's
_TURN_COUNTER, _READ_COUNTER = "turns", "read"  # filters that count; no template can name them


class WorkCountingContext(_Context):
    """The names of one rendering, and how much work it has done."""

    work_steps = 0

    def add_work(self, work: int) -> None:
        """Count work; SecurityError if it is too much."""
        self.work_steps += work
        if self.work_steps > MOST_WORK_STEPS:
            raise SecurityError(f"it does more than {MOST_WORK_STEPS} steps of work")


class TemplateEnvironment(ImmutableSandboxedEnvironment):
    """Compiles templates that use only the allowed constructs, `functions` and `filters`."""

    context_class = WorkCountingContext
    intercepted_binops = frozenset({"+", "-", "*", "/", "//", "%"})

    def __init__(
        self,
        *,
        functions: Mapping[str, Callable[..., Any]],
        filters: Mapping[str, Callable[..., Any]],
        finalize: Callable[[Any], str],
    ) -> None:
        super().__init__(
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
            keep_trailing_newline=True,
            finalize=finalize,
        )
        jinja_filters = {name: self.filters[name] for name in _JINJA_FILTERS}
        self.filters = {
            name: _counting_filter(function) for name, function in {**jinja_filters, **filters}.items()
        }
        self.filter_names = frozenset(self.filters)
        self.filters |= {
            _TURN_COUNTER: _count_loop_work,
            _READ_COUNTER: _counting_filter(lambda value: value),
        }
        self.globals = dict(functions)
        self.compiled_template = lru_cache(maxsize=256)(self._compile_template)

    def _compile_template(self, text: str) -> Template:
        """Return the template; TemplateSyntaxError with the line of a construct that is not allowed."""
        if len(text) > MOST_TEMPLATE_OR_RESULT_CHARACTERS:
            raise TemplateSyntaxError(
                f"{len(text)} characters instead of at most {MOST_TEMPLATE_OR_RESULT_CHARACTERS}", 1
            )
        tree = self.parse(text)
        self._check_nodes(tree)
        for loop in tree.find_all(nodes.For):
            size = nodes.Const(_count_nodes(loop))
            loop.iter = _with_filter(loop.iter, _TURN_COUNTER, size)
        _add_read_counters(tree)
        return Template.from_code(self, self.compile(tree), self.make_globals(None))

    def _check_nodes(self, tree: nodes.Template) -> None:
        """Reject what is not allowed, before any part of it is evaluated; loops stand beside each other."""
        queue: deque[tuple[nodes.Node, int, bool]] = deque([(tree, 0, False)])
        node_count = 0
        while queue:
            node, depth, in_loop = queue.popleft()
            node_count += 1
            if why := self._problem_of_node(node, depth, node_count, in_loop):
                raise TemplateSyntaxError(why, node.lineno)
            in_loop = in_loop or isinstance(node, nodes.For)
            queue.extend((child, depth + 1, in_loop) for child in node.iter_child_nodes())

    def _problem_of_node(self, node: nodes.Node, depth: int, node_count: int, in_loop: bool) -> str:
        if depth > MOST_NESTED_NODES or node_count > MOST_TEMPLATE_NODES:
            return f"more than {MOST_TEMPLATE_NODES} parts, or nested more than {MOST_NESTED_NODES} deep"
        if not isinstance(node, _ALLOWED_NODES):
            return f"`{getattr(node, 'operator', None) or type(node).__name__.lower()}` is not allowed"
        if isinstance(node, nodes.For) and (in_loop or node.recursive):
            return "a loop in a loop"
        if isinstance(node, nodes.Filter) and node.name not in self.filter_names:
            return f"no filter named '{node.name}'"
        if isinstance(node, nodes.Test) and node.name not in _ALLOWED_TESTS:
            return f"no test named '{node.name}'"
        if isinstance(node, nodes.Call):
            return self._problem_of_call(node)
        if isinstance(node, nodes.Getattr) and not _is_allowed_attribute(node):
            return f"`.{node.attr}` is not allowed"
        if isinstance(node, nodes.List) or (isinstance(node, nodes.Tuple) and node.ctx == "load"):
            return (
                "" if all(isinstance(item, nodes.Const) for item in node.items) else "a list of non-constants"
            )
        return ""

    def _problem_of_call(self, node: nodes.Call) -> str:
        called = node.node
        if node.kwargs or node.dyn_args or node.dyn_kwargs:
            return "a call with keywords or stars"
        if isinstance(called, nodes.Name) and called.name in self.globals:
            return ""
        if isinstance(called, nodes.Getattr) and called.attr in _ALLOWED_METHODS:
            return ""
        return f"a call of `{getattr(called, 'name', None) or getattr(called, 'attr', 'an expression')}`"

    def call_binop(self, context: Any, operator: str, left: Any, right: Any) -> Any:
        """Calculate with numbers, and add texts or lists."""
        if operator == "+" and isinstance(left, str | list) and type(left) is type(right):
            context.add_work(len(left) + len(right))
        elif not (_is_number_within_limit(left) and _is_number_within_limit(right)):
            kinds = f"{type(left).__name__} {operator} {type(right).__name__}"
            raise SecurityError(f"{kinds} is not allowed")
        return super().call_binop(context, operator, left, right)

    def call(__self, __context: Any, __function: Any, *args: Any, **kwargs: Any) -> Any:  # noqa: N805 (Jinja2's)
        __context.add_work(_count_characters(getattr(__function, "__self__", None)))
        return super().call(__context, __function, *args, **kwargs)

    @staticmethod
    def concat(pieces: Iterable[str]) -> str:
        """Join the pieces of a result."""
        return "".join(_pieces_within_limit(pieces))


def _with_filter(node: nodes.Node, name: str, *args: nodes.Expr) -> nodes.Filter:
    return nodes.Filter(node, name, list(args), [], None, None, lineno=node.lineno)


def _add_read_counters(tree: nodes.Template) -> None:
    """Count what comparisons, the test `in` and slices read, each time they are evaluated."""
    for node in list(tree.find_all((nodes.Compare, nodes.Operand, nodes.Test, nodes.Getitem))):
        if isinstance(node, nodes.Compare | nodes.Operand):
            node.expr = _with_filter(node.expr, _READ_COUNTER)
        elif isinstance(node, nodes.Test) and node.name == "in":
            node.node = _with_filter(node.node, _READ_COUNTER)
            node.args = [_with_filter(value, _READ_COUNTER) for value in node.args]
        elif isinstance(node, nodes.Getitem) and isinstance(node.arg, nodes.Slice):
            node.node = _with_filter(node.node, _READ_COUNTER)


def _pieces_within_limit(pieces: Iterable[str]) -> Iterator[str]:
    total = 0
    for piece in pieces:
        total += len(piece)
        if total > MOST_TEMPLATE_OR_RESULT_CHARACTERS:
            raise SecurityError(f"it writes more than {MOST_TEMPLATE_OR_RESULT_CHARACTERS} characters")
        yield piece


def _counting_filter(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let a filter count the characters of its value, and `join` also those of its separators."""

    @pass_context
    @wraps(function)
    def counted(context: WorkCountingContext, value: Any, *args: Any) -> Any:
        times = len(value) if isinstance(value, list | tuple) else 1
        context.add_work(_count_characters(value) + times * sum(map(_count_characters, args)))
        return function(value, *args)

    return counted


@pass_context
def _count_loop_work(context: WorkCountingContext, value: Any, size: int) -> Any:
    if not isinstance(value, list | tuple):
        raise SecurityError(f"a loop over a {type(value).__name__}")
    context.add_work(len(value) * size)
    return value


def _is_allowed_attribute(node: nodes.Getattr) -> bool:
    is_loop = isinstance(node.node, nodes.Name) and node.node.name == "loop"
    return node.attr in (_ALLOWED_LOOP_ATTRIBUTES if is_loop else _ALLOWED_METHODS)


def _count_nodes(node: nodes.Node) -> int:
    return 1 + sum(1 for _ in node.find_all(nodes.Node))


def _count_characters(value: object) -> int:
    """Return the number of characters in a text or a list of texts; 1 for other values."""
    if isinstance(value, str):
        return len(value)
    return sum(map(_count_characters, value)) if isinstance(value, list | tuple) else 1


def _is_number_within_limit(value: object) -> bool:
    if isinstance(value, int):
        return value.bit_length() <= _MOST_NUMBER_BITS
    return isinstance(value, float)
