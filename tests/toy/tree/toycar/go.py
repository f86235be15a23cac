"""Runs one case: `python -m toycar.go CASE --to DIR --number N [--alone] [--film FOLDER]`."""

import json
import sys
from pathlib import Path

import numpy as np

from toycar.driver import Driver
from toycar.sensing import Sensor
from toycar.world import World


class Drive:
    """One run, step by step."""

    def __init__(self, case):
        self.world = World(case)
        self.sensor = Sensor()
        self.driver = Driver()
        self.commands = (0.0, 0.0, 0.0)
        self.rows = []
        self.steps = int(case["steps"])

    def step(self):
        world = self.world
        now = world.advance(*self.commands)
        world.judge(now)
        self.sensor.sense(world)
        self.commands = self.driver.drive(now, world.speed, self.sensor.reading)
        self.rows.append((now, world.gap, world.speed, world.lead_speed, world.offset, *self.commands))

    @property
    def done(self):
        return len(self.rows) == self.steps

    def write(self, to):
        names = ("time", "gap", "speed", "lead_speed", "offset", "gas", "brake", "wheel_turn")
        columns = np.array(self.rows).T
        np.savez(to / "log.npz", **dict(zip(names, columns, strict=True)))
        said = {
            "hazards": self.world.hazards,
            "alert_events": [{"name": name, "t": t} for name, t in self.driver.warned],
        }
        (to / "said.json").write_text(json.dumps(said))


def begin(arguments):
    case_file, number = arguments[0], int(arguments[4])
    case = dict(line.split(": ") for line in Path(case_file).read_text().splitlines() if ": " in line)
    case = {key: float(value) for key, value in case.items()}
    if "--alone" in arguments:
        case |= {"gap": 500.0, "lead_brakes": 0.0}
    case["gap"] += number * 0.001
    return Drive(case)


def main(arguments):
    drive = begin(arguments)
    while not drive.done:
        drive.step()
    drive.write(Path(arguments[2]))
    if "--film" in arguments:
        film = Path(arguments[arguments.index("--film") + 1])
        film.mkdir()
        (film / "offset.txt").write_text(str(drive.world.offset))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
