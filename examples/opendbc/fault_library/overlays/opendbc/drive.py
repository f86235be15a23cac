"""The closed loop: a car that follows another, controlled by opendbc's CarInterface."""

from opendbc.can import CANPacker, CANParser
from opendbc.car import structs
from opendbc.car.toyota.interface import CarInterface

from mutator.glue import Run


class Drive(Run):
    def __init__(self, scenario, seed):
        super().__init__(step_s=0.01, duration_s=scenario["duration_s"])
        self.controller = CarInterface(CarInterface.get_non_essential_params(scenario["car"]))
        dbc = self.controller.can_parsers["pt"].dbc_name
        self.packer, self.actuator = CANPacker(dbc), CANParser(dbc, [("ACC_CONTROL", 0)], 0)
        self.gap, self.speed, self.lead = scenario["gap_m"], scenario["speed_mps"], scenario["speed_mps"]
        self.accel, self.brakes = 0.0, scenario["lead_brakes_mps2"]

    def step(self):
        gap, now = self.gap, round(self.t * 1e9)
        wheels = {f"WHEEL_SPEED_{wheel}": self.speed * 3.6 for wheel in ("FL", "FR", "RL", "RR")}
        sensed = {"WHEEL_SPEEDS": wheels, "VSC1S07": {"GVC": self.accel}, "PCM_CRUISE": {"CRUISE_ACTIVE": 1}}
        frames = [self.packer.make_can_msg(name, 0, values) for name, values in sensed.items()]
        seen = self.controller.update([(now, frames)])
        control = structs.CarControl(enabled=True, longActive=True)
        control.actuators.longControlState = "pid"
        control.actuators.accel = 0.2 * (gap - 5 - 1.5 * seen.vEgo) + 0.8 * (self.lead - seen.vEgo)
        self.actuator.update([(now, self.controller.apply(control.as_reader(), now)[1])])
        command = self.actuator.vl["ACC_CONTROL"]["ACCEL_CMD"]
        self.accel += (command - self.accel) * self.step_s / 0.3  # the engine's lag
        self.speed = max(0.0, self.speed + self.accel * self.step_s)
        self.lead = max(0.0, self.lead - self.brakes * self.step_s * (self.t > 5))
        self.gap += (self.lead - self.speed) * self.step_s
        self.record(gap=gap, speed=self.speed, seen=seen.vEgo, command=command)


if __name__ == "__main__":
    Drive.main()
