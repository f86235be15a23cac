"""How long the steering torque is at its limit without faults: `python benchmarks/torque_limit.py RUN`.

Reads the golden runs of a run folder of the shipped target, and drives nothing. For each scenario and range
of speeds, it prints the share of the time, after 1.5 s, in which the torque is at its limit.
"""

import argparse
from pathlib import Path

import numpy as np

from mutator.outcomes.trace_and_record_loading import load_trace
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

SPEEDS_MPS = ((23, 28), (18, 23), (14, 18), (12, 14), (10, 12), (0, 10))
BEGIN_S, STEP_S, LIMIT = 1.5, 0.01, 0.999


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition(":")[0] + ".")
    parser.add_argument("run", type=Path, metavar="RUN")
    folder = RunFolder.open(parser.parse_args().run)
    manifest = Workspace.find().manifest_of(folder.head)
    for golden in folder.goldens_with_files:
        if "no_lead" in golden.changes:
            continue
        trace = load_trace(manifest, folder.golden_folder(*golden))
        speed, is_limited = trace["v_ego"], np.abs(trace["steer_torque"]) >= LIMIT
        texts = []
        for low, high in SPEEDS_MPS:
            is_in_range = (speed >= low) & (speed < high) & (trace["t"] > BEGIN_S)
            if is_in_range.any():
                share, time_s = is_limited[is_in_range].mean(), is_in_range.sum() * STEP_S
                texts.append(f"{low} to {high} m/s: {share:.0%} of {time_s:.1f} s")
        print(f"{golden.scenario}: {'; '.join(texts)}")


if __name__ == "__main__":
    main()
