"""Thirty changes of the shipped controller, for benchmarks: refactorings, and changes of what it does."""

from dataclasses import dataclass
from pathlib import Path

REFACTORING, OUTSIDE_GOLDEN, ELSEWHERE = "refactoring", "code that golden never executes", "elsewhere"


@dataclass(frozen=True)
class Change:
    """A change of the controller: each old text, which its file has once, becomes the new one."""

    group: str
    name: str
    path: str
    edits: tuple[tuple[str, str], ...]


LIB = "selfdrive/controls/lib"
HONDA = "selfdrive/car/honda"
CHANGES = (
    Change(
        REFACTORING,
        "comment",
        "selfdrive/common/interp.py",
        (("    if x >= xp[-1]:", "    # beyond the last\n    if x >= xp[-1]:"),),
    ),
    Change(
        REFACTORING,
        "blank lines",
        f"{LIB}/alertmanager.py",
        (("        alert, t0 =", "\n\n        alert, t0 ="),),
    ),
    Change(
        REFACTORING,
        "layout",
        f"{LIB}/cruise_plan.py",
        (("    a_total = interp(v_ego, *A_TOTAL)", "    a_total = interp(\n        v_ego, *A_TOTAL\n    )"),),
    ),
    Change(
        REFACTORING,
        "lab",
        "selfdrive/visiond_lab/random_looks.py",
        (("\nimport numpy", "\n# arrays\nimport numpy"),),
    ),
    Change(
        REFACTORING,
        "renamed variable",
        f"{LIB}/state_machine.py",
        (
            (
                "        for name in names:\n            alerts.add(name, t)\n\n    def _soften",
                "        for alert in names:\n            alerts.add(alert, t)\n\n    def _soften",
            ),
        ),
    ),
    Change(
        REFACTORING,
        "condition",
        f"{LIB}/longcontrol.py",
        (
            (
                "if speed < CREEP_SPEED else 0.0",
                "if CREEP_SPEED > speed else 0.0",
            ),
        ),
    ),
    Change(
        REFACTORING,
        "stop state",
        f"{LIB}/longcontrol.py",
        (
            (
                "        self.output = clip(self.output, -brake_max, gas_max)\n        self.reset(car.v_ego)",
                "        self.reset(car.v_ego)\n        self.output = clip(self.output, -brake_max, gas_max)",
            ),
        ),
    ),
    Change(
        REFACTORING,
        "constant",
        f"{LIB}/fcw.py",
        (
            (
                "BLINKER_STEP = 10.0 / 60.0",
                "CYCLES_WITHOUT_BLINKER = 60.0\nBLINKER_STEP = 10.0 / CYCLES_WITHOUT_BLINKER",
            ),
        ),
    ),
    Change(
        REFACTORING,
        "extracted function",
        f"{LIB}/radar_helpers.py",
        (
            (
                " or abs(self.v_rel - first.v_rel) > SECOND_SPEED",
                " or self._differs_in_speed(first)\n\n"
                '    def _differs_in_speed(self, first: "Cluster") -> bool:\n'
                "        return abs(self.v_rel - first.v_rel) > SECOND_SPEED",
            ),
        ),
    ),
    Change(
        REFACTORING,
        "film",
        "selfdrive/sim/film/timeline.py",
        (("\nimport cv2", "\nimport math\n\nimport cv2"),),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "brake limit",
        f"{HONDA}/interface.py",
        (("brake_max=((5.0, 20.0), (1.0, 0.8))", "brake_max=((5.0, 20.0), (0.5, 0.4))"),),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "alert threshold",
        f"{LIB}/pid.py",
        (("SATURATION_TIME = 0.8", "SATURATION_TIME = 0.99"),),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "stop state",
        f"{LIB}/longcontrol.py",
        (
            (
                "            self.output -= STOPPING_BRAKE_RATE * DT_CTRL",
                "            self.output -= 0.5 * STOPPING_BRAKE_RATE * DT_CTRL",
            ),
        ),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "disengaging",
        f"{LIB}/state_machine.py",
        (
            (
                "        self.state = DISABLED\n        for name in names:",
                "        self.state = SOFT_DISABLING\n        for name in names:",
            ),
        ),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "no radar error",
        "selfdrive/controls/plannerd.py",
        (("        return (RADAR_ERROR,) if radar_lost else ()", "        return ()"),),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "no model error",
        "selfdrive/controls/plannerd.py",
        (
            (
                "            return (MODEL_ERROR, RADAR_ERROR) if radar_lost else (MODEL_ERROR,)\n",
                "            return ()\n",
            ),
        ),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "message age",
        "selfdrive/controls/plannerd.py",
        (("MAX_AGE = 0.5", "MAX_AGE = 30.0"),),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "brake limit at speed",
        f"{HONDA}/interface.py",
        (("brake_max=((5.0, 20.0), (1.0, 0.8))", "brake_max=((5.0, 20.0), (1.0, 0.4))"),),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "windup",
        f"{LIB}/pid.py",
        (("        if up_ok or down_ok:\n            self.i = integral", "        self.i = integral"),),
    ),
    Change(
        OUTSIDE_GOLDEN,
        "doubt in lane width",
        f"{LIB}/pathplanner.py",
        (("WIDTH_DOUBT = ((0.3, 1.0), (1.0, 0.0))", "WIDTH_DOUBT = ((0.3, 5.0), (1.0, 0.0))"),),
    ),
    Change(
        ELSEWHERE,
        "speed gains",
        f"{HONDA}/interface.py",
        (
            ("long_kp=((0.0, 5.0, 35.0), (3.6, 2.4, 1.5))", "long_kp=((0.0, 5.0, 35.0), (0.36, 0.24, 0.15))"),
            ("long_ki=((0.0, 35.0), (0.54, 0.36))", "long_ki=((0.0, 35.0), (0.05, 0.04))"),
        ),
    ),
    Change(
        ELSEWHERE,
        "steering gain",
        f"{HONDA}/interface.py",
        (("steer_kp=((0.0,), (0.8 * RAD_TO_DEG,))", "steer_kp=((0.0,), (0.3 * RAD_TO_DEG,))"),),
    ),
    Change(
        ELSEWHERE,
        "brake scale",
        f"{HONDA}/carcontroller.py",
        (("self._brake * BRAKE_COUNTS", "0.5 * self._brake * BRAKE_COUNTS"),),
    ),
    Change(
        ELSEWHERE,
        "brake rise",
        f"{HONDA}/carcontroller.py",
        (("MOST_BRAKE_RISE_PER_STEP = 1.0 * DT_CTRL", "MOST_BRAKE_RISE_PER_STEP = 0.1 * DT_CTRL"),),
    ),
    Change(
        ELSEWHERE, "lane width of leads", f"{LIB}/radar_helpers.py", (("LANE_HALF = 1.5", "LANE_HALF = 0.3"),)
    ),
    Change(
        ELSEWHERE,
        "lead filter",
        f"{LIB}/radar_helpers.py",
        (("LEAD_GAINS = (0.1988689, 0.28555364)", "LEAD_GAINS = (0.02, 0.003)"),),
    ),
    Change(
        ELSEWHERE,
        "lane width filter",
        f"{LIB}/pathplanner.py",
        (("WIDTH_RATE = 0.005", "WIDTH_RATE = 0.5"),),
    ),
    Change(
        ELSEWHERE,
        "speed filter",
        f"{HONDA}/carstate.py",
        (("SPEED_KALMAN_GAINS = (0.12287673, 0.29666309)", "SPEED_KALMAN_GAINS = (0.03, 0.03)"),),
    ),
    Change(
        ELSEWHERE,
        "acceleration per output",
        f"{HONDA}/interface.py",
        (("acceleration_per_output=4.8", "acceleration_per_output=20.0"),),
    ),
    Change(
        ELSEWHERE,
        "comfort limit",
        f"{LIB}/longcontrol.py",
        (("self._pid.neg_limit = -brake_max", "self._pid.neg_limit = -min(brake_max, 0.6)"),),
    ),
)


def apply_change(change: Change, target: Path) -> None:
    path = target / change.path
    text = path.read_text()
    for old, new in change.edits:
        assert old in text, (change.name, old)
        text = text.replace(old, new, 1)
    path.write_text(text)


def main() -> int:
    """List the changes."""
    for change in CHANGES:
        print(f"{change.group}: {change.name} ({change.path})")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
