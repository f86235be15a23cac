"""Measure the lateral behaviour at 60 mph: overshoot, settling time and steady error.

`python benchmarks/lateral.py [--figure FILE.svg]` simulates scenarios L01 to L03 and a step of the lane and
prints a table. With `--figure` it plots offset, steering angle and torque over time.
"""

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.sim.scenario import load_scenario  # noqa: E402
from selfdrive.sim.simulator import Simulator  # noqa: E402

STEP, STEP_AT = 0.5, 8.0  # m to the left, s
CASES = (  # case, scenario, step of the lane (m), start of the disturbance (s), settling band (m)
    ("start 0.5 m left", "L01", 0.0, 1.31, 0.025),
    ("lane steps 0.5 m left", "L01", STEP, STEP_AT, 0.025),
    ("bend of 500 m", "L02", 0.0, 7.4, 0.025),
    ("bend beyond full torque", "L03", 0.0, 7.4, 0.05),
)
HEADER = f"{'case':24} {'largest':>8} {'beyond':>8} {'settled':>8} {'steady':>8} {'torque':>7} {'full':>6}"

Trace = Mapping[str, np.ndarray]


def drive(name: str, step: float) -> Trace:
    """Simulate a scenario. With a `step`, the car starts centred, and the lane later moves to the left."""
    simulator = Simulator()
    simulator.reset(load_scenario(ROOT / "fault_library" / "scenarios" / f"{name}.yaml"), 0)
    if step:
        simulator._plant.lateral.offset = 0.0
    while not simulator.is_finished:
        if simulator.frame == round(STEP_AT * 100):
            simulator._plant.lateral.offset -= step
        simulator.step()
    return simulator.result().trace


def measure(trace: Trace, start: float, band: float) -> tuple[float, ...]:
    """Return the largest offset and the overshoot to the other side (m), the settling time (s), the steady
    error (m), the largest torque, and the time (s) at full torque. Settled means within `band` of the steady
    offset.
    """
    t, offset = trace["t"], trace["lateral_offset"]
    steady = offset[-100:].mean()
    side = np.sign(offset[np.abs(offset).argmax()])
    outside = np.flatnonzero((np.abs(offset - steady) > band) & (t >= start))
    torque = np.abs(trace["steer_torque"])
    return (
        np.abs(offset).max(),
        max(-(side * offset[t >= start]).min(), 0.0),
        t[outside[-1]] - start,
        side * steady,
        torque.max(),
        (torque > 1.0).sum() / 100,
    )


def figure(traces: Mapping[str, Trace], path: Path) -> None:
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "lateral"
    from matplotlib import pyplot

    rows = (("lateral_offset", "offset (m)"), ("steer_angle", "wheel (deg)"), ("steer_torque", "torque"))
    fig, axes = pyplot.subplots(len(rows), len(traces), figsize=(13, 6), sharex="col", sharey="row")
    for column, (case, trace) in zip(axes.T, traces.items(), strict=True):
        column[0].set_title(case, fontsize=10)
        column[-1].set_xlabel("t (s)")
        for axis, (channel, _) in zip(column, rows, strict=True):
            values = np.degrees(trace[channel]) if channel == "steer_angle" else trace[channel]
            axis.plot(trace["t"][::5], values[::5], linewidth=1.2)
            axis.grid(alpha=0.3)
    for axis, (_, label) in zip(axes[:, 0], rows, strict=True):
        axis.set_ylabel(label)
    fig.tight_layout()
    fig.savefig(path, metadata={"Date": None})


def main() -> int:
    parser = argparse.ArgumentParser(description="Measure the lateral behaviour of the controlled car.")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw the runs into this SVG file")
    options = parser.parse_args()
    print(HEADER)
    traces = {}
    for case, name, step, start, band in CASES:
        traces[case] = drive(name, step)
        largest, beyond, settled, steady, torque, full = measure(traces[case], start, band)
        print(
            f"{case:24} {largest:6.3f} m {beyond:6.3f} m {settled:6.2f} s {steady:6.3f} m "
            f"{torque:7.3f} {full:4.2f} s"
        )
    if options.figure:
        figure(traces, options.figure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
