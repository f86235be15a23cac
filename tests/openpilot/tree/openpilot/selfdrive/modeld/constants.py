"""Times of a model's output in s."""


class ModelConstants:
    IDX_N = 3
    T_IDXS = (0.0, 1.0, 2.0)
