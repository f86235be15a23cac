"""The controller's clock: time is a frame number times one of these."""

DT_CTRL = 0.01  # s, plant and control loop
DT_MDL = 0.05  # s, vision model, radar, planners
