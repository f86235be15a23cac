"""A pole on a motor: angle in rad, rate in rad/s, torque in N m."""

import math

GRAVITY = 9.81
LENGTH = 1.0


class Pole:
    def __init__(self, angle):
        self.angle = angle
        self.rate = 0.0

    def push(self, torque, dt):
        self.rate += (GRAVITY / LENGTH * math.sin(self.angle) + torque) * dt
        self.angle += self.rate * dt
