"""The 21 nodes of both model-predictive controllers, and the intervals between them."""

LATERAL_STEP = 0.05  # s, of RK4
LONGITUDINAL_STEP = 0.2  # s
INTERVALS = ((1, 1.0),) * 5 + ((3, 3.0),) * 15  # (RK4 steps, weight)
N_NODES = len(INTERVALS) + 1
