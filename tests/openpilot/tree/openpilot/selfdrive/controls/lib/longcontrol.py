"""Commands the planned acceleration: a stand-in."""


class LongControl:
    def __init__(self, params):
        self.long_control_state, self.last_output_accel = "off", 0.0

    def update(self, active, state, a_target, should_stop, accel_limits):
        lowest, highest = accel_limits
        has_plan = active and isinstance(a_target, float)
        self.long_control_state = "pid" if active else "off"
        self.last_output_accel = sorted((lowest, a_target if has_plan else 0.0, highest))[1]
        return self.last_output_accel
