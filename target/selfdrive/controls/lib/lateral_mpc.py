"""Lateral model-predictive control: how to steer along a path between two lanes."""

from dataclasses import dataclass

from selfdrive.car.params import CarParams

Poly = tuple[float, float, float, float]


@dataclass(slots=True)
class Lanes:
    """The road ahead: cubics y(x) in m, highest power first, left positive, and their probabilities."""

    left_poly: Poly
    right_poly: Poly
    path_poly: Poly  # the model's path
    left_prob: float
    right_prob: float
    lane_width: float  # m


class LateralMpc:
    """Plans the road-wheel angle; one real-time iteration an update (20 Hz, with each model message).

    Results: `angle_desired` (rad at the steering wheel, offset included), `delta_desired` (rad at the
    road wheels, 0.05 s ahead), `delta_plan` (21 nodes, 0..2.5 s), `nans` (the last solution was
    unusable) and `resets`, the number of such solutions.
    """

    def __init__(self, params: CarParams) -> None:
        """Uses the car's steering ratio, actuation delay and steering rate cost."""
        self.params = params
        self.angle_desired = 0.0
        self.delta_desired = 0.0
        self.delta_plan: tuple[float, ...] = (0.0,) * 21
        self.nans = False
        self.resets = 0

    def reset(self) -> None:
        """Back to the state after construction, without building the solver again."""
        raise NotImplementedError

    def update(
        self,
        lanes: Lanes,
        v_ego: float,
        steering_angle: float,
        angle_offset: float,
        curvature_factor: float,
    ) -> float:
        """Plan for `lanes`; returns `angle_desired` (rad at the steering wheel).

        Speed in m/s; measured steering-wheel angle and its learnt offset in rad; `curvature_factor`
        in 1/m, the curvature of the car's path for a road-wheel angle of 1 rad. Call it with
        every model message, engaged or not, as the original does: the plan starts from its own last
        angle. An unusable solution gives NaN, once; the next one starts anew at the measured angle.
        """
        raise NotImplementedError
