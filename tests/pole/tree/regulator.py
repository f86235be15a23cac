"""Keeps a pole upright."""

from filters import LowPass


class Regulator:
    def __init__(self):
        self.smooth = LowPass(0.5)
        self.before = 0.0

    def torque(self, angle, dt):
        estimate = self.smooth.update(angle)
        rate = (estimate - self.before) / dt
        self.before = estimate
        torque = -40.0 * estimate - 9.0 * rate
        return max(-20.0, min(20.0, torque))
