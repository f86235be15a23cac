"""Everything that a run's bytes depend on is computed in an explicit order.

`selfdrive.common.ordered` and `selfdrive.common.array_math` give the reasons and the replacements.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

TARGET = Path(__file__).parents[2] / "target"
NO_RESULT = (  # files that draw, compare or train; CasADi computes symbols in the given order
    "selfdrive/sim/film/*",
    "selfdrive/sim/compare/*",
    "selfdrive/sim/effects/effects_page.py",
    "selfdrive/sim/effects/degradation.py",
    "selfdrive/visiond_lab/*",
    "selfdrive/controls/lib/lateral_ocp.py",
    "selfdrive/controls/lib/mpc_solver.py",
)
PRODUCTS = {
    "dot",
    "vdot",
    "inner",
    "matmul",
    "tensordot",
    "einsum",
    "convolve",
    "correlate",
    "linalg",
    "polyfit",
}
FUNCTIONS = {
    *("exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "power", "float_power", "cbrt", "logaddexp"),
    *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh"),
    *("hypot", "corrcoef", "cov", "arcsinh", "arccosh", "arctanh", "sinc", "logspace", "geomspace"),
}
UNORDERED = {"partition", "argpartition"}
SORTS = {"argsort"}  # the order of equal values does not matter
EXACT = {  # whole numbers, and sums that a double holds exactly, where order does not matter
    ("can/packer.py", "sum(data.translate(_HALF_BYTE_SUMS))"),
    ("can/parser.py", "sum((field.mask << field.shift for field in self.fields))"),
    ("sim/recorder.py", "sum((1 << bit for bit, name in enumerate(COUNTED_ALERTS) if name in alerts))"),
    (
        "visiond/lane_net.py",
        "np.matmul(some, self.hidden_steps, out=steps[k:k + WINDOWS_AT_ONCE])",
    ),
}


def found(source: str) -> Iterator[str]:
    """Return expressions whose order or last digits depend on Python or the processor."""
    for node in ast.walk(ast.parse(source)):
        is_product = isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult)
        by_name = isinstance(node, ast.ImportFrom) and node.module in {"numpy", "numpy.linalg"}
        if is_product or by_name or (isinstance(node, ast.Call) and _is_unordered(node)):
            yield ast.unparse(node)


def _is_unordered(call: ast.Call) -> bool:
    function = call.func
    if isinstance(function, ast.Name):
        return function.id in {"sum", "sumprod", "fmean"}
    if not isinstance(function, ast.Attribute):
        return False
    path = ast.unparse(function).split(".")
    if path[-1] in SORTS:
        return not any(word.arg == "kind" and ast.unparse(word.value) == "'stable'" for word in call.keywords)
    if path[-1] in {"sumprod", "fmean"}:
        return True
    if path[0] in {"np", "numpy"}:
        return bool({*path[1:]} & (PRODUCTS | FUNCTIONS | UNORDERED))
    return path[-1] == "dot" or path in (["cv2", name] for name in ("exp", "log", "pow", "gemm", "solve"))


def test_results_depend_on_no_order() -> None:
    wrong = []
    for path in sorted(TARGET.rglob("*.py")):
        name = path.relative_to(TARGET)
        if not any(name.match(pattern) for pattern in NO_RESULT):
            short = name.relative_to("selfdrive").as_posix() if name.parts[0] == "selfdrive" else str(name)
            wrong += [f"{name}: {text}" for text in found(path.read_text()) if (short, text) not in EXACT]
    assert not wrong


@pytest.mark.parametrize(
    "line",
    [
        "a = sum(values)",
        "a = b @ c",
        "a @= b",
        "a = np.einsum('i,i', b, c)",
        "a = np.linalg.solve(b, c)",
        "a = b.dot(c)",
        "a = np.exp(b)",
        "a = np.argsort(b)",
        "a = b.argsort()",
        "a = np.argpartition(b, 3)",
        "a = cv2.exp(b)",
        "a = math.sumprod(b, c)",
        "a = statistics.fmean(b)",
        "from numpy import dot",
    ],
)
def test_an_order_dependent_line_is_found(line: str) -> None:
    assert len(list(found(line))) == 1


@pytest.mark.parametrize(
    "line", ["a = total(b)", "a = b.sum()", "a = math.exp(b)", "a = b.argsort(kind='stable')"]
)
def test_an_order_independent_line_is_not_found(line: str) -> None:
    assert not list(found(line))
