"""Iterations of model-predictive control, with any solver."""

from array import array
from collections.abc import Callable, Sequence
from typing import Protocol


class Buffers(Protocol):
    def set_arg(self, i: int, values: memoryview) -> None:
        """Set the doubles that argument `i` is read from."""

    def set_res(self, i: int, values: memoryview) -> None:
        """Set the doubles that result `i` is written to."""


class Solver(Protocol):
    """One iteration as a function with three arguments and three results; see `build_solver`."""

    def size1_in(self, i: int) -> int:
        """Length of argument `i`."""

    def size1_out(self, i: int) -> int:
        """Length of result `i`."""

    def buffer(self) -> tuple[Buffers, Callable[[], None]]:
        """Return the buffers to set, and the function that solves with them."""


class Iteration:
    """Runs a solver on its own buffers and keeps the trajectory between iterations.

    The next iteration linearises at the trajectory `guess`; `solution` is the last one computed: the states
    node by node, then the controls. `unsolved` counts finite iterations without a solution, which use the
    solver's fallback.
    """

    def __init__(self, solver: Solver) -> None:
        self._buffer, self._evaluate = solver.buffer()
        inputs = [array("d", bytes(8 * solver.size1_in(i))) for i in range(3)]
        outputs = [array("d", bytes(8 * solver.size1_out(i))) for i in range(3)]
        for i, (arg, res) in enumerate(zip(inputs, outputs, strict=True)):
            self._buffer.set_arg(i, memoryview(arg))
            self._buffer.set_res(i, memoryview(res))
        self.guess, self._start, self._param = inputs
        self.solution, self._next, self._flags = outputs
        n_state = len(self._start)
        self._n_control = (len(self.guess) - n_state) // (n_state + 1)
        self.unsolved = 0

    def restart(self, nodes: Sequence[float] | None = None, control: float = 0.0) -> None:
        """Reset the guess to the states of all nodes (None: zeros) and a constant control."""
        controls = array("d", [control]) * self._n_control
        states = array("d", nodes or bytes(8 * (len(self.guess) - self._n_control)))
        self.guess[:] = states + controls

    def run(self, start: Sequence[float], param: Sequence[float]) -> bool:
        """Run one iteration from the state `start`; return False if the solution is not finite."""
        self._start[:] = array("d", start)
        self._param[:] = array("d", param)
        self._evaluate()
        self.guess[:] = self._next
        solved, finite = self._flags
        if finite and not solved:
            self.unsolved += 1
        return finite == 1.0
