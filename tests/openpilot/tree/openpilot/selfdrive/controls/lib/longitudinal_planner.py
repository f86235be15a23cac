"""Plans an acceleration: a stand-in."""

from cereal import messaging as messages

from openpilot.selfdrive.controls.lib.longitudinal_mpc_lib.long_mpc import LongitudinalMpc

LOWEST_ACCEL, HIGHEST_ACCEL, FORCED_ACCEL = -3.5, 2.0, -2.0
NEEDED = "carState", "controlsState", "selfdriveState", "radarState"


class LongitudinalPlanner:
    def __init__(self, params, init_v=0.0):
        self.mpc, self.fcw, self.output_a_target = LongitudinalMpc(), False, 0.0

    def update(self, sm):
        car, controls = sm["carState"], sm["controlsState"]
        v_ego = car.vEgo
        accel = self.mpc.update(sm["radarState"], v_ego, car.vCruise / 3.6)
        self.fcw = self.mpc.alarmed_steps > 2
        wanted = FORCED_ACCEL if controls.forceDecel else accel
        self.output_a_target = sorted((LOWEST_ACCEL, wanted, HIGHEST_ACCEL))[1]

    def publish(self, sm, pm):
        message = messages.new_message("longitudinalPlan", valid=sm.all_checks(NEEDED))
        plan = message.longitudinalPlan
        plan.aTarget, plan.shouldStop = self.output_a_target, False
        pm.send(message.topic, message)
