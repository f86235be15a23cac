"""The controller's time steps."""

DT_CTRL = 0.01  # s, plant and control loop
DT_MDL = 0.05  # s, vision model, radar, planners
