"""The third loop: the torque controller steers a kinematic car through a bend."""

import math

import numpy as np
from bus import Bus
from opendbc.car.car_helpers import interfaces
from opendbc.car.vehicle_model import VehicleModel
from openpilot.common.realtime import DT_CTRL
from openpilot.selfdrive.controls.lib.drive_helpers import clip_curvature
from openpilot.selfdrive.controls.lib.latcontrol_torque import LatControlTorque

LAG_S = 0.15  # from torque to curvature
NEAR_PER_M2, ALONG_PER_M = 0.004, 0.12  # how the path leads back: by the offset, by the heading


class Loop:
    STEP_S = DT_CTRL

    def __init__(self, scenario):
        interface = interfaces[scenario["car"]]
        self.params = interface.get_non_essential_params(scenario["car"]).as_reader()
        self.vehicle, self.bus = VehicleModel(self.params), Bus()
        self.control = LatControlTorque(self.params, interface(self.params), DT_CTRL)
        self.control_reads = self.bus.reader(["carState", "liveParameters"], "carState")
        self.scenario, self.speed, self.alerts = scenario, scenario["speed_mps"], {}
        self.offset = self.heading = self.curvature = self.desired = 0.0

    def truth(self, t):
        road = float(np.interp(t, self.scenario["times_s"], self.scenario["curvature_per_m"]))
        return {"offset": self.offset, "heading": self.heading, "speed": self.speed, "road": road}

    def step(self, t):
        speed, road = self.speed, self.truth(t)["road"]
        path = road - NEAR_PER_M2 * self.offset - ALONG_PER_M * self.heading  # a camera without errors
        self.bus.now = t
        message, state = self.bus.new("carState")
        state.vEgo = speed
        angle = self.vehicle.get_steer_from_curvature(-self.curvature, speed, 0.0)
        state.steeringAngleDeg = math.degrees(angle)
        self.bus.send("carState", message)
        self.bus.send("liveParameters", self.bus.new("liveParameters")[0])
        self.bus.read(self.control_reads)
        state, live = self.control_reads["carState"], self.control_reads["liveParameters"]
        self.desired, limited = clip_curvature(state.vEgo, self.desired, path, live.roll)
        arguments = (self.desired, limited, self.params.steerActuatorDelay)
        torque, _, log = self.control.update(True, state, self.vehicle, live, False, *arguments)
        torque = float(np.clip(torque, -1, 1)) if math.isfinite(torque) else 0.0  # as controlsd does
        self.alerts = {"steer_saturated": bool(log.saturated)}
        reached = -torque * self.params.lateralTuning.torque.latAccelFactor / speed**2
        self.curvature += (reached - self.curvature) * DT_CTRL / LAG_S
        self.heading += (self.curvature - road) * speed * DT_CTRL
        self.offset += math.sin(self.heading) * speed * DT_CTRL
        return {"desired": self.desired, "measured": log.actualLateralAccel, "torque": torque}
