"""Small Kalman filters on plain floats."""


class SteadyKalman:
    """Two states, value and rate, with fixed gains; the value is measured.

    As in the original, the innovation uses the last estimate, not its prediction: x <- (A - K C) x + K z with
    A = [[1, dt], [0, 1]] and C = [1, 0].
    """

    __slots__ = ("dt", "gain_rate", "gain_value", "rate", "value")

    def __init__(self, value: float, rate: float, *, dt: float, gains: tuple[float, float]) -> None:
        self.value = value
        self.rate = rate
        self.dt = dt
        self.gain_value, self.gain_rate = gains

    def update(self, measured: float) -> None:
        innovation = measured - self.value
        self.value += self.dt * self.rate + self.gain_value * innovation
        self.rate += self.gain_rate * innovation


class DistanceFilter:
    """Distance and its rate from a distance measurement of known variance (covariance form).

    As in the original, each prediction adds the same process noise, whatever the step.
    """

    __slots__ = ("p00", "p01", "p11", "q_distance", "q_rate", "rate", "value")

    def __init__(self, *, variance: float, q_distance: float, q_rate: float) -> None:
        self.value = 0.0
        self.rate = 0.0
        self.p00 = variance
        self.p01 = 0.0
        self.p11 = variance
        self.q_distance = q_distance
        self.q_rate = q_rate

    def restart(self, value: float, variance: float, rate_variance: float) -> None:
        self.value = value
        self.rate = 0.0
        self.p00 = variance
        self.p01 = 0.0
        self.p11 = rate_variance

    def update(self, measured: float, variance: float) -> None:
        innovation = measured - self.value
        total = self.p00 + variance
        k0 = self.p00 / total
        k1 = self.p01 / total
        self.value += k0 * innovation
        self.rate += k1 * innovation
        self.p11 -= k1 * self.p01
        self.p01 -= k0 * self.p01
        self.p00 -= k0 * self.p00

    def predict(self, dt: float) -> None:
        self.value += dt * self.rate
        self.p00 += dt * (2.0 * self.p01 + dt * self.p11) + self.q_distance
        self.p01 += dt * self.p11
        self.p11 += self.q_rate
