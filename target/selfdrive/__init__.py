"""An openpilot-like driving controller (ACC and LKAS) and, under `sim/`, its PC simulator."""
