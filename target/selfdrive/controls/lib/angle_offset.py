"""Learns the steering-wheel angle at which the car drives straight."""

from selfdrive.common.conversions import DEG_TO_RAD, RAD_TO_DEG
from selfdrive.common.interp import clip

MAX_OFFSET = 5.0 * DEG_TO_RAD  # rad
# rad per m of error and m/s, per update: one degree in two minutes at 30 m/s and 0.5 m
LEARN_RATE = DEG_TO_RAD / 36000.0
MIN_LEARN_SPEED = 1.0  # m/s
TURN_FACTOR = 0.02 * RAD_TO_DEG  # 1/(rad m/s); learns less in turns


class AngleOffset:
    def __init__(self, value: float = 0.0) -> None:
        self.value = value  # rad at the steering wheel

    def update(self, v_ego: float, lane_center: float, lane_prob: float, steering_angle: float) -> None:
        slow = 1.0 / (1.0 + TURN_FACTOR * abs(steering_angle) * v_ego)
        rate = LEARN_RATE * lane_prob * max(v_ego - MIN_LEARN_SPEED, 0.0) * slow
        self.value = clip(self.value + lane_center * rate, -MAX_OFFSET, MAX_OFFSET)
