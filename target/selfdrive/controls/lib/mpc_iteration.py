"""Iterations of model-predictive control, one after the other, whatever solver makes them."""

from array import array
from collections.abc import Callable, Sequence
from typing import Protocol


class Buffers(Protocol):
    """Where a solver finds its arguments and puts its results."""

    def set_arg(self, i: int, values: memoryview) -> None:
        """Doubles that argument `i` is read from."""

    def set_res(self, i: int, values: memoryview) -> None:
        """Doubles that result `i` is written to."""


class Solver(Protocol):
    """One iteration as a function of three arguments and with three results, as `build_solver` says them.

    It is what is used of a CasADi function.
    """

    def size1_in(self, i: int) -> int:
        """Length of argument `i`."""

    def size1_out(self, i: int) -> int:
        """Length of result `i`."""

    def buffer(self) -> tuple[Buffers, Callable[[], None]]:
        """Buffers to be set, and what solves from and to them."""


class Iteration:
    """Runs a solver on buffers of its own; holds the trajectory from one iteration to the next.

    `guess` is the trajectory the next iteration linearises at, `solution` the last one computed: the
    states node by node, then the controls. They are written in place. `unsolved` counts the finite
    iterations that kept the controls.
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
        """Guess anew: the states of all nodes (None: zeros) and the same control all along."""
        controls = array("d", [control]) * self._n_control
        states = array("d", nodes or bytes(8 * (len(self.guess) - self._n_control)))
        self.guess[:] = states + controls

    def run(self, start: Sequence[float], param: Sequence[float]) -> bool:
        """One iteration from the state `start`; False when the solution is not finite."""
        self._start[:] = array("d", start)
        self._param[:] = array("d", param)
        self._evaluate()
        self.guess[:] = self._next
        solved, finite = self._flags
        if finite and not solved:
            self.unsolved += 1
        return finite == 1.0
