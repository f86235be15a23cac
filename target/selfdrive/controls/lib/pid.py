"""PI control with feedforward, anti-windup and detection of saturation."""

from collections.abc import Callable

from selfdrive.common.interp import clip, interp
from selfdrive.common.realtime import DT_CTRL

UNWIND_RATE = 0.3  # 1/s, rate at which the integrator unwinds while the driver overrides
SATURATION_TIME = 0.8  # s

Table = tuple[tuple[float, ...], tuple[float, ...]]


class PIController:
    """PI controller at 100 Hz. Gains are tables over speed (m/s).

    `convert(control, speed)` converts the sum of the terms to the actuator's unit before limiting.
    `saturated` becomes True after more than 0.8 s at a limit with an error above `min_error`.
    """

    def __init__(
        self,
        kp: Table,
        ki: Table,
        *,
        convert: Callable[[float, float], float] | None = None,
        min_error: float = 0.1,
    ) -> None:
        self._kp = kp
        self._ki = ki
        self._convert = convert
        self._min_error = min_error
        self.pos_limit = 1.0
        self.neg_limit = -1.0
        self.reset()

    def reset(self) -> None:
        self.p = 0.0
        self.i = 0.0
        self.f = 0.0
        self.saturated = False
        self._saturated_for = 0.0  # s

    def update(
        self,
        setpoint: float,
        measured: float,
        *,
        speed: float,
        feedforward: float = 0.0,
        override: bool = False,
        check_saturation: bool = True,
    ) -> float:
        error = setpoint - measured
        self.p = error * interp(speed, *self._kp)
        self.f = feedforward
        if override:
            self.i -= UNWIND_RATE * DT_CTRL * ((self.i > 0.0) - (self.i < 0.0))
        else:
            self._integrate(error, speed)
        control = self._output(self.i, speed)
        self._count_saturation(control, error, override, check_saturation)
        return clip(control, self.neg_limit, self.pos_limit)

    def _output(self, integral: float, speed: float) -> float:
        control = self.p + self.f + integral
        return self._convert(control, speed) if self._convert else control

    def _integrate(self, error: float, speed: float) -> None:
        integral = self.i + error * interp(speed, *self._ki) * DT_CTRL
        control = self._output(integral, speed)
        up_ok = error >= 0.0 and (control <= self.pos_limit or integral < 0.0)
        down_ok = error <= 0.0 and (control >= self.neg_limit or integral > 0.0)
        if up_ok or down_ok:
            self.i = integral

    def _count_saturation(self, control: float, error: float, override: bool, check: bool) -> None:
        if not check:
            self.saturated = False
            return
        beyond = control < self.neg_limit or control > self.pos_limit
        step = DT_CTRL if beyond and not override and abs(error) > self._min_error else -DT_CTRL
        self._saturated_for = clip(self._saturated_for + step, 0.0, 1.0)
        self.saturated = self._saturated_for > SATURATION_TIME
