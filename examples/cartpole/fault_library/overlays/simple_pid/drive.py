"""The loop that mutator drives: Gymnasium's CartPole and PID.__call__, one step at a time."""

import gymnasium
from simple_pid.pid import PID

from mutator.glue import Run


class Drive(Run):
    def __init__(self, scenario, seed):
        super().__init__(step_s=0.02, duration_s=scenario["duration_s"])
        self.env = gymnasium.make("CartPole-v1").unwrapped
        self.env.reset(seed=seed)
        self.place_m = scenario["place_m"]
        self.controller = PID(-10, 0, -2, sample_time=None, time_fn=lambda: self.t)

    def step(self):
        place, speed, angle, _ = map(float, self.env.state)
        if self.env.steps_beyond_terminated is not None:
            self.end()  # the pole lies, or the cart is off its track
        lean = 0.05 * (self.place_m - place) - 0.1 * speed  # back to where the cart belongs
        self.controller.setpoint = min(max(lean, -0.1), 0.1)
        command = self.controller(angle, dt=self.step_s)
        self.env.step(int(command > 0))
        self.record(place=place, angle=angle, command=command)


if __name__ == "__main__":
    Drive.main()
