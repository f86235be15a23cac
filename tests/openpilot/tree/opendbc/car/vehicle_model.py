"""A car whose curvature is proportional to the angle of its wheel."""

RATIO = 0.02  # curvature in 1/m by angle in rad


class VehicleModel:
    def __init__(self, params):
        self.params = params

    def get_steer_from_curvature(self, curvature, speed, roll):
        return curvature / RATIO

    def calc_curvature(self, angle, speed, roll):
        return angle * RATIO
