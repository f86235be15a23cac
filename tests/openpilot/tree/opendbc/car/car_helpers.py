"""Cars by name: here, the same for each."""

from cereal import Content


class CarInterface:
    def __init__(self, params):
        self.params = params

    @staticmethod
    def get_non_essential_params(name):
        lateral = Content(torque=Content(latAccelFactor=2.0))
        return Content(radarDelay=0.0, steerActuatorDelay=0.1, lateralTuning=lateral)

    @staticmethod
    def get_pid_accel_limits(params, speed, cruise):
        return -3.5, 2.0


interfaces = {"TOYOTA_COROLLA_TSS2": CarInterface}
