"""What makes a distance look longer, for tests of faults that bring a class of the target with them."""


class Haze:
    """Adds `amount` m, and a bit for each thing seen through it."""

    def __init__(self, amount, seed, eye):
        self.amount, self.seen = amount + seed % 7 * 0.01, 0

    def apply(self, gap, world):
        self.seen += 1
        return gap + self.amount + 0.001 * self.seen
