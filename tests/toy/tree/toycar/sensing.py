"""What the car measures of the world."""


class Sensor:
    """Distance and speed difference to the car ahead, offset in the lane. m, m/s."""

    def __init__(self):
        self.reading = (100.0, 0.0, 0.0)

    def sense(self, world):
        gap = world.gap
        closing = world.speed - world.lead_speed
        offset = world.offset
        self.publish((gap, closing, offset))

    def publish(self, reading):
        self.reading = reading
