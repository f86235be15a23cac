"""Plans an acceleration."""

from cereal import messaging

from openpilot.selfdrive.controls.lib.longitudinal_mpc_lib.long_mpc import LongitudinalMpc


class LongitudinalPlanner:
    def __init__(self, params, init_v=0.0):
        self.mpc = LongitudinalMpc()
        self.fcw = False
        self.output_a_target = 0.0

    def update(self, sm):
        v_ego = sm["carState"].vEgo
        v_cruise = sm["carState"].vCruise / 3.6
        output_a_target = self.mpc.update(sm["radarState"], v_ego, v_cruise)
        if sm["controlsState"].forceDecel:
            output_a_target = -2.0
        self.fcw = self.mpc.crash_cnt > 2
        self.output_a_target = max(-3.5, min(2.0, output_a_target))

    def publish(self, sm, pm):
        plan_send = messaging.new_message("longitudinalPlan")
        plan_send.valid = sm.all_checks(["carState", "controlsState", "selfdriveState", "radarState"])
        plan_send.longitudinalPlan.aTarget = self.output_a_target
        plan_send.longitudinalPlan.shouldStop = False
        pm.send("longitudinalPlan", plan_send)
