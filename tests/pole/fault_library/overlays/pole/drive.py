"""Drives the pole: `python -m drive --scenario FILE --seed N --out DIR`."""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from glue_parts.scenario import start_angle
from pole import Pole
from regulator import Regulator

DT = 0.02
STEPS = 300


class Run:
    def __init__(self, arguments):
        parser = argparse.ArgumentParser()
        parser.add_argument("--scenario", type=Path)
        parser.add_argument("--seed", type=int)
        parser.add_argument("--out", type=Path)
        options = parser.parse_args(arguments)
        self.out = options.out
        self.pole = Pole(start_angle(options.scenario) + 1e-4 * options.seed)
        self.regulator = Regulator()
        self.rows = []
        self.fell = None

    @property
    def done(self):
        return len(self.rows) == STEPS

    def step(self):
        now = len(self.rows) * DT
        torque = self.regulator.torque(self.pole.angle, DT)
        self.pole.push(torque, DT)
        if self.fell is None and abs(self.pole.angle) > 0.5:
            self.fell = now
        self.rows.append((now, self.pole.angle, torque))

    def write(self, out):
        names = ("t", "angle", "torque")
        np.savez(out / "trace.npz", **dict(zip(names, np.array(self.rows).T, strict=True)))
        hazards = {} if self.fell is None else {"FALL": self.fell}
        (out / "record.json").write_text(json.dumps({"hazards": hazards, "alert_events": []}))


def open_run(arguments):
    return Run(arguments)


if __name__ == "__main__":
    run = open_run(sys.argv[1:])
    while not run.done:
        run.step()
    run.write(run.out)
