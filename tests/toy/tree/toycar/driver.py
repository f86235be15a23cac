"""The controller: keeps a headway of 1.5 s and the middle of the lane."""


class Driver:
    """From a reading to gas, brake and wheel, each at most 1."""

    def __init__(self):
        self.warned = []

    def drive(self, t, speed, reading):
        gap, closing, offset = reading
        wanted = 0.4 * (gap - 5.0 - 1.5 * speed) - 1.2 * closing
        if speed > 30.0:
            wanted = min(wanted, 0.0)
        gas = min(max(wanted / 3.0, 0.0), 1.0)
        brake = min(max(-wanted / 6.0, 0.0), 1.0)
        wheel = max(min(-0.6 * offset, 1.0), -1.0)
        if brake > 0.9:
            self.warned.append(("brake_hard", t))
        return gas, brake, wheel
