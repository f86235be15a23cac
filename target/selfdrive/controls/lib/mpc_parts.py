"""Generates a part of `mpc.c`. Run `python -m selfdrive.controls.lib.mpc_parts` after changing a problem.

The generated part contains what CasADi derives from each optimal control problem, one statement per
operation, in order. Tests of `compiled_mpc` show whether `mpc.c` gives the same bits as a new CasADi.
"""

from collections.abc import Iterator
from pathlib import Path

import casadi as ca

from selfdrive.controls.lib.lateral_ocp import lateral_ocp
from selfdrive.controls.lib.long_ocp import long_ocp
from selfdrive.controls.lib.mpc_solver import Ocp, rk4

C_FILE = Path(__file__).with_name("mpc.c")
BEGIN, END = "/* begin: written by mpc_parts.py */\n", "/* end: written by mpc_parts.py */\n"
OPERATIONS = {
    ca.OP_ADD: "{} + {}",
    ca.OP_SUB: "{} - {}",
    ca.OP_MUL: "{} * {}",
    ca.OP_DIV: "{} / {}",
    ca.OP_NEG: "-{}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {}",
    ca.OP_INV: "1.0 / {}",
    ca.OP_SQRT: "sqrt({})",
    ca.OP_EXP: "exp({})",
    ca.OP_SIN: "sin({})",
    ca.OP_COS: "cos({})",
    ca.OP_ATAN: "atan({})",
}


def parts() -> str:
    return "\n".join(text for ocp in (long_ocp(), lateral_ocp(0.0)) for text in _of(ocp))


def _of(ocp: Ocp) -> Iterator[str]:
    nx = ocp.n_state
    zu, p = ca.SX.sym("zu", nx + 1), ca.SX.sym("p", ocp.n_param)
    stage, terminal = ocp.residuals(zu[:-1], zu[-1], p)
    step = rk4(ocp)
    z, u = zu[:-1], zu[-1]
    end, a, b = step(z, u, p)
    outputs = [end, a, b, _over(a, ocp.rk4_step / 6)]
    yield _function(
        f"{ocp.name}_rk4", ca.Function("rk4", [z, u, p], outputs), ("z", "u", "p"), ("end", "a", "b", "over")
    )
    for name, residuals in (("stage", stage), ("end", terminal)):
        c = ca.jacobian(residuals, zu)
        of = ca.Function(name, [zu, p], [residuals, c, _over(c, 0.1), _under(c)])
        yield _function(f"{ocp.name}_{name}", of, ("zu", "p"), ("r", "c", "over", "under"))


def _over(a: ca.SX, factor: float) -> ca.SX:
    of_product = ca.SX(a.shape[0], a.shape[1])
    for i, j in zip(*a.sparsity().get_triplet(), strict=True):
        element = a[i, j]
        if element.op() == ca.OP_MUL and element.dep(0).is_constant() and float(element.dep(0)) == factor:
            of_product[i, j] = element.dep(1)
    return of_product


def _under(c: ca.SX) -> ca.SX:
    of_quotient = ca.SX(c.shape[0], c.shape[1])
    for i, j in zip(*c.sparsity().get_triplet(), strict=True):
        element = c[i, j]
        if element.op() == ca.OP_INV:
            of_quotient[i, j] = element.dep(0)
        elif element.op() == ca.OP_NEG and element.dep(0).op() == ca.OP_INV:
            of_quotient[i, j] = -element.dep(0).dep(0)
    return of_quotient


def _function(name: str, of: ca.Function, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> str:
    """Return a C function. Matrices are row-major; elements that are always 0 are not written."""
    words = [f"const double *{word}" for word in inputs] + [f"double *{word}" for word in outputs]
    lines = [f"static void {name}({', '.join(words)})", "{"]
    now: list[str] = [""] * of.sz_w()  # current variable of each place of the work vector
    for k in range(of.n_instructions()):
        operation, to, at = of.instruction_id(k), of.instruction_output(k), of.instruction_input(k)
        if operation == ca.OP_INPUT:
            now[to[0]] = f"{inputs[at[0]]}[{at[1]}]"
        elif operation == ca.OP_CONST:
            value = of.instruction_constant(k)
            now[to[0]] = repr(value) if value >= 0.0 else f"({value!r})"
        elif operation == ca.OP_OUTPUT:
            which, element = to
            row, column = (places[element] for places in of.sparsity_out(which).get_triplet())
            place = row * of.size2_out(which) + column
            lines.append(f"    {outputs[which]}[{place}] = {now[at[0]]};")
        else:
            lines.append(f"    double v{k} = {OPERATIONS[operation].format(*(now[i] for i in at))};")
            now[to[0]] = f"v{k}"
    return "\n".join([*lines, "}", ""])


def with_parts(text: str) -> str:
    before, rest = text.split(BEGIN)
    return before + BEGIN + parts() + END + rest.split(END)[1]


def main() -> None:
    C_FILE.write_text(with_parts(C_FILE.read_text()))


if __name__ == "__main__":
    main()
