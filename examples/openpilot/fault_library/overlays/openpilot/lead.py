"""The second loop: radard, planner and longcontrol, joined by their own messages, behind a lead."""

import numpy as np
from bus import Bus
from cereal import car
from opendbc.car.car_helpers import interfaces
from openpilot.common.realtime import DT_CTRL, DT_MDL
from openpilot.selfdrive.controls.lib.longcontrol import LongControl
from openpilot.selfdrive.controls.lib.longitudinal_planner import LongitudinalPlanner
from openpilot.selfdrive.controls.radard import RADAR_TO_CAMERA, RadarD
from openpilot.selfdrive.modeld.constants import ModelConstants

LAG_S = 0.3  # of the car's acceleration
SOFT_DISABLE_S, START_S = 3.0, 1.0  # until openpilot lets go; the watchdog begins later than the messages
STATE = ["carState", "controlsState", "selfdriveState"]


class Loop:
    STEP_S = DT_MDL

    def __init__(self, scenario):
        self.scenario, self.alerts, self.bus = scenario, {}, Bus()
        self.car = interfaces[scenario["car"]]
        self.params = self.car.get_non_essential_params(scenario["car"])
        self.gap, self.speed, self.accel, self.command = scenario["gap_m"], scenario["speed_mps"], 0.0, 0.0
        self.radard, self.control = RadarD(self.params.radarDelay), LongControl(self.params)
        self.planner = LongitudinalPlanner(self.params, init_v=self.speed)
        self.radard_reads = self.bus.reader(["modelV2", "carState", "liveTracks"], "modelV2")
        others = ["carControl", "liveParameters", "radarState", "modelV2"]
        self.planner_reads = self.bus.reader([*STATE, *others], "modelV2")
        self.control_reads = self.bus.reader(["carState", "longitudinalPlan"], "carState")
        self.watchdog_reads = self.bus.reader(["modelV2", "radarState", "longitudinalPlan"], "modelV2")
        self.trouble_s = 0.0

    def truth(self, t):
        lead = float(np.interp(t, self.scenario["times_s"], self.scenario["lead_mps"]))
        return {"gap": self.gap, "speed": self.speed, "lead": lead, "acceleration": self.accel}

    def step(self, t):
        lead = self.truth(t)["lead"]
        accel = (self.truth(t + DT_MDL)["lead"] - lead) / DT_MDL
        for tick in range(round(DT_MDL / DT_CTRL)):
            self.bus.now = t + tick * DT_CTRL
            self.drive(lead)
        self.see(lead, accel)
        self.bus.read(self.radard_reads)
        self.radard.update(self.radard_reads, self.radard_reads["liveTracks"])
        self.radard.publish(self.bus)
        self.bus.read(self.planner_reads)
        self.planner.update(self.planner_reads)
        self.planner.publish(self.planner_reads, self.bus)
        self.bus.read(self.watchdog_reads)
        trouble = t > START_S and not self.watchdog_reads.all_checks()
        self.trouble_s = self.trouble_s + DT_MDL if trouble else 0.0
        self.alerts = {"fcw": bool(self.planner.fcw), "comm_issue": trouble}
        one = self.radard.radar_state.leadOne
        fused = {"lead_seen": one.status, "lead_gap": one.dRel, "lead_speed": one.vLead}
        return fused | {"target": self.planner.output_a_target, "command": self.command}

    def drive(self, lead):
        """Control and move the car for one step of openpilot's control loop."""
        disabling = self.scenario["watchdog"] and self.trouble_s > 0
        active = not (disabling and self.trouble_s > SOFT_DISABLE_S)
        message, state = self.bus.new("carState")
        state.vEgo, state.aEgo, state.standstill = self.speed, self.accel, self.speed < 0.01
        state.vCruise = self.scenario["cruise_mps"] * 3.6
        self.bus.send("carState", message)
        message, state = self.bus.new("controlsState")
        state.longControlState, state.forceDecel = self.control.long_control_state, disabling
        self.bus.send("controlsState", message)
        message, state = self.bus.new("selfdriveState")
        state.enabled, state.active, state.personality = active, active, "standard"
        self.bus.send("selfdriveState", message)
        self.bus.send("carControl", self.bus.new("carControl")[0])
        self.bus.read(self.control_reads)
        state, plan = self.control_reads["carState"], self.control_reads["longitudinalPlan"]
        limits = self.car.get_pid_accel_limits(self.params, state.vEgo, state.vCruise / 3.6)
        command = self.control.update(active, state, plan.aTarget, plan.shouldStop, limits)
        self.command = float(command) if np.isfinite(command) else 0.0  # as controlsd does
        self.accel += (self.command - self.accel) * DT_CTRL / LAG_S
        if self.speed <= 0:
            self.accel = max(0.0, self.accel)
        self.speed = max(0.0, self.speed + self.accel * DT_CTRL)
        self.gap += (lead - self.speed) * DT_CTRL

    def see(self, lead, accel):
        """Send what a camera and a radar without errors would report."""
        message, model = self.bus.new("modelV2")
        times, ones = np.array(ModelConstants.T_IDXS), np.ones(ModelConstants.IDX_N)
        model.position.x = (self.speed * times).tolist()
        model.velocity.x = (self.speed * ones).tolist()
        model.acceleration.x = (0.0 * ones).tolist()
        model.meta.disengagePredictions.gasPressProbs = [1.0] * 6
        for seen, prob in zip(model.init("leadsV3", 2), (1.0, 0.0), strict=True):
            seen.prob, seen.x, seen.y = prob, [self.gap + RADAR_TO_CAMERA], [0.0]
            seen.v, seen.a, seen.xStd, seen.yStd, seen.vStd = [lead], [accel], [2.0], [0.5], [1.0]
        self.bus.send("modelV2", message)
        message, tracks = self.bus.new("liveTracks")
        ahead = {"trackId": 1, "dRel": self.gap, "yRel": 0.0, "vRel": lead - self.speed}
        beside = {"trackId": 2, "dRel": 40.0, "yRel": 4.5, "vRel": -self.speed}  # stands beside the road
        tracks.points = [car.RadarData.RadarPoint(**point, measured=True) for point in (ahead, beside)]
        self.bus.send("liveTracks", message)
        self.bus.send("liveParameters", self.bus.new("liveParameters")[0])
