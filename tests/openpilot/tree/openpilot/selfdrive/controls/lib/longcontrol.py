"""Commands the planned acceleration."""


class LongCtrlState:
    off = "off"
    pid = "pid"


class LongControl:
    def __init__(self, params):
        self.long_control_state = LongCtrlState.off
        self.last_output_accel = 0.0

    def update(self, active, state, a_target, should_stop, accel_limits):
        self.long_control_state = LongCtrlState.pid if active else LongCtrlState.off
        wish = a_target if active and isinstance(a_target, float) else 0.0
        self.last_output_accel = max(accel_limits[0], min(accel_limits[1], wish))
        return self.last_output_accel
