"""The solvers of both model-predictive controllers: compiled C if available, else CasADi's.

CasADi is imported only if needed, because importing it and building both solvers is slow.
"""

import ctypes
from array import array
from collections.abc import Callable, Sequence
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from selfdrive.common import compiled
from selfdrive.controls.lib.horizon import INTERVALS, N_NODES
from selfdrive.controls.lib.mpc_iteration import Solver

C_SOURCE = Path(__file__).with_name("mpc.c")
CASADI_VERSION = "3.8.2"  # the version whose arithmetic the C file reproduces
LONGITUDINAL_WEIGHTS = (5.0, 0.1, 10.0, 20.0)  # as in `long_ocp`
LATERAL_WEIGHTS = (1.0, 1.0, 1.0, 1.0)  # as in `lateral_ocp`, except for the steering rate's


class MpcCode(NamedTuple):
    library: ctypes.CDLL
    daqp: ctypes.c_void_p


def build_longitudinal() -> Solver:
    if code := _load_code():
        return CompiledSolver(code, "long_iteration", LONGITUDINAL_WEIGHTS, n_state=6, n_param=1)
    from selfdrive.controls.lib.long_ocp import long_ocp
    from selfdrive.controls.lib.mpc_solver import build_solver

    return build_solver(long_ocp())


def build_lateral(steer_rate_cost: float) -> Solver:
    if code := _load_code():
        weights = (*LATERAL_WEIGHTS, steer_rate_cost)
        return CompiledSolver(code, "lateral_iteration", weights, n_state=4, n_param=17)
    from selfdrive.controls.lib.lateral_ocp import lateral_ocp
    from selfdrive.controls.lib.mpc_solver import build_solver

    return build_solver(lateral_ocp(steer_rate_cost))


def _load_code() -> MpcCode | None:
    library = compiled.library(C_SOURCE)
    daqp = _find_daqp() if library else None
    if library is None or daqp is None or not library.code.agrees(daqp):
        return None
    return MpcCode(library.code, daqp)


@cache
def _find_daqp() -> ctypes.c_void_p | None:
    """`daqp_quadprog` of CasADi's DAQP; None if it is missing or CasADi's version differs."""
    casadi = find_spec("casadi")
    if casadi is None or casadi.origin is None:
        return None
    folder = Path(casadi.origin).parent
    if not folder.with_name(f"casadi-{CASADI_VERSION}.dist-info").is_dir():
        return None
    try:
        return ctypes.cast(ctypes.CDLL(str(folder / "libdaqp.so")).daqp_quadprog, ctypes.c_void_p)
    except (OSError, AttributeError):
        return None


class CompiledSolver:
    def __init__(
        self, code: MpcCode, iteration: str, weights: Sequence[float], *, n_state: int, n_param: int
    ) -> None:
        self._iterate = getattr(code.library, iteration)
        self._iterate.restype = None
        self._daqp, self._weights = code.daqp, array("d", weights)
        n_trajectory = n_state * N_NODES + len(INTERVALS)
        self._inputs = n_trajectory, n_state, n_param
        self._outputs = n_trajectory, n_trajectory, 2

    def size1_in(self, i: int) -> int:
        return self._inputs[i]

    def size1_out(self, i: int) -> int:
        return self._outputs[i]

    def buffer(self) -> tuple["CallAddresses", Callable[[], None]]:
        addresses = CallAddresses(self._daqp, memoryview(self._weights))
        return addresses, partial(self._iterate, addresses.arguments)


class CallAddresses:
    def __init__(self, daqp: ctypes.c_void_p, weights: memoryview) -> None:
        self.arguments = (ctypes.c_void_p * 8)(daqp)
        self._buffers: dict[int, Any] = {}
        self._set(1, weights)

    def set_arg(self, i: int, values: memoryview) -> None:
        self._set(2 + i, values)

    def set_res(self, i: int, values: memoryview) -> None:
        self._set(5 + i, values)

    def _set(self, place: int, values: memoryview) -> None:
        self._buffers[place] = ctypes.c_double.from_buffer(values)
        self.arguments[place] = ctypes.addressof(self._buffers[place])
