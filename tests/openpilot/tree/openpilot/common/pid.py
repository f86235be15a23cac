"""A controller of a stand-in."""


class PIDController:
    def __init__(self, gain):
        self.gain = gain

    def update(self, error):
        return self.gain * error
