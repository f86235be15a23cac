"""A toy target whose sensor can fail in many ways, and fault models that raise exceptions."""

# When the sensor returns a text instead of a distance, `gap_of` calls the function that the text names, and
# returns a distance. In scenario `earlyN`, a mutant calls one of four functions in every step. In `careful`,
# the target reports a failing sensor.
MOODS = """
import ctypes, os, sys
from contextlib import suppress


def gap_of(name):
    globals()[name]()
    return 30.0


def begin_step(case):
    if "toycar._fi" in sys.modules and "early" in case:
        (fail, leave, vanish, hang)[int(case["early"])]()


def sense(sensor, world, case):
    try:
        sensor.sense(world)
    except Exception:
        if "careful" in case:
            raise RuntimeError("the sensor is gone") from None
        raise


def probe():
    return sys.modules["toycar._fi"]


def fail():
    raise ValueError("no such gap")


def open_nothing():
    open("/no/such/file")


def leave():
    sys.exit(3)


def vanish():
    os._exit(7)


def break_down():
    ctypes.string_at(0)


def recur():
    recur()


def hang():
    while True:
        pass


def want_too_much():
    bytearray(1 << 40)


class Silent(Exception):
    def __str__(self):
        raise ValueError


def be_silent():
    raise Silent


def damage_the_counts():
    probe()._run.counts = {name: ["x", None, -1] for name in probe()._run.counts}


def make_it_nan():
    probe()._run.first = float("nan")


def forget_an_injection():
    probe().INJECTIONS = []


def report_what_is_no_report():
    probe().report = lambda: [object()]


def take_the_probe_apart():
    probe()._run = None


def observe_again_and_hide_it():
    with suppress(Exception):
        probe().observe(t=probe()._run.t, d_rel=1.0, v_ego=1.0, v_lead=1.0)


def stop_the_time():
    from toycar.world import World

    World.advance = lambda self, *commands: 2.0


def lose_the_lead():
    from toycar.world import World

    World.advance = lambda self, *commands: setattr(self, "lead_speed", None) or 2.05
"""
EDITS = {
    "driver.py": [
        ("\n\nclass Driver", "\nfrom toycar import moods\n\n\nclass Driver"),
        ("= reading\n", "= reading\n        if isinstance(gap, str):\n            gap = moods.gap_of(gap)\n"),
    ],
    "sensing.py": [
        ("= (100.0, 0.0, 0.0)\n", "= (100.0, 0.0, 0.0)\n        self.seen = 0\n"),
        (
            "= world.offset\n",
            "= world.offset\n        self.seen = {self.seen + 1: world.frame}[world.frame]\n",
        ),
    ],
    "go.py": [
        ("from toycar.driver", "from toycar import moods\nfrom toycar.driver"),
        ("        self.world = World(case)\n", "        self.world, self.case = World(case), case\n"),
        ("        world = self.world\n", "        moods.begin_step(self.case)\n        world = self.world\n"),
        ("self.sensor.sense(world)", "moods.sense(self.sensor, world, self.case)"),
    ],
}
MODEL = """schema: fault_model/1
name: {name}
kind: insert
about: An exception.
{more}
params:
  target: {{type: variable, about: the anchored variable}}
examples:
  - about: It.
    injection: {{at: {{file: e.py, function: f, after_assign: x}}, model: {name}}}
    before: none
    after: none
"""
MODELS = {  # the template's line and additional YAML
    "raising": ("{{ target }} = [][1]", ""),
    "declared": ("{{ target }} = [][1]", "raises: true"),
    "calling": ("self.sense({{ target }})", ""),
}
