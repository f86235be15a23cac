"""Runs one case: `python -m toycar.go CASE --to DIR --number N [--alone] [--film FOLDER]`."""

import json
import struct
import sys
from pathlib import Path

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
        from zipfile import ZipFile, ZipInfo  # late, as other targets import what writes their files

        names = ("time", "gap", "speed", "lead_speed", "offset", "gas", "brake", "wheel_turn")
        with ZipFile(to / "log.npz", "w") as log:
            for name, column in zip(names, zip(*self.rows, strict=True), strict=True):
                log.writestr(ZipInfo(f"{name}.npy"), npy(column))
        said = {
            "hazards": self.world.hazards,
            "alert_events": [{"name": name, "t": t} for name, t in self.driver.warned],
        }
        (to / "said.json").write_text(json.dumps(said))


def npy(column):
    """The bytes of NumPy's file of numbers. To import NumPy would take longer than the run."""
    head = repr({"descr": "<f8", "fortran_order": False, "shape": (len(column),)}).ljust(117) + "\n"
    return struct.pack(f"<8sH118s{len(column)}d", b"\x93NUMPY\x01", len(head), head.encode(), *column)


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
