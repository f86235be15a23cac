class LowPass:
    def __init__(self, share):
        self.share = share
        self.value = 0.0

    def update(self, new):
        self.value += self.share * (new - self.value)
        return self.value
