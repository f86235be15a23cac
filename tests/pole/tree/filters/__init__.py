from filters.low_pass import LowPass

__all__ = ["LowPass"]
