"""The words of the shipped target's library and of the examples', for `tests.sentence_check`."""

import numpy as np

from tests.sentence_check import Channels, Loop


def _car_with_pedals() -> Loop:
    return Loop(
        directions={
            "gives more gas": ("gas", 1), "gives less gas": ("gas", -1),
            "brakes harder": ("brake", 1), "brakes less": ("brake", -1), "brakes to": ("brake", 1),
            "steers further left": ("steer_torque", 1), "steers further right": ("steer_torque", -1),
        },
        actuators=("gas", "brake", "steer_torque"),
        faster=(("gas", 1), ("brake", -1)),
        slower=(("gas", -1), ("brake", 1)),
        speed="v_ego",
        hazards={
            "touches the vehicle ahead": lambda run: (run["d_rel"] <= 0.0) & (_aside(run) <= 2.75),
            "stops": lambda run: (
                np.maximum.accumulate(run["v_ego"] >= 0.3) & (run["v_ego"] < 0.3) & (run["d_rel"] >= 100.0)
            ),
            "leaves its lane": lambda run: _aside(run) > 0.95,
        },
        terminal=("touches the vehicle ahead",),
        numbers={
            "touches the vehicle ahead": (
                r"at (-?[0-9.]+) m/s", lambda run: float((run["v_ego"] - run["v_lead"])[-1])
            ),
            "leaves its lane": (
                r"by up to (-?[0-9.]+(?:e-?[0-9]+)?) m", lambda run: max(float(_aside(run).max()) - 0.95, 0.0)
            ),
        },
        situation=_behind_a_lead,
        has_alerts=True,
    )  # fmt: skip


def _aside(run: Channels) -> np.ndarray:
    return np.abs(run["lateral_offset"])


def _behind_a_lead(run: Channels) -> dict[str, np.ndarray]:
    with np.errstate(divide="ignore", invalid="ignore"):
        hwt = np.where(run["v_ego"] > 0.0, run["d_rel"] / run["v_ego"], np.inf)
    return {"hwt": hwt, "rs": run["v_ego"] - run["v_lead"]}


OPENPILOT = _car_with_pedals()
CARTPOLE = Loop(
    directions={
        "pushes the cart further right": ("command", 1), "pushes the cart further left": ("command", -1),
    },
    actuators=("command",),
    hazards={
        "the pole falls": lambda run: np.abs(run["angle"]) > 0.2,
        "the cart leaves its track": lambda run: np.abs(run["place"]) > 2.35,
    },
    terminal=("the pole falls", "the cart leaves its track"),
    numbers={},
    situation=lambda run: {"place": run["place"]},
    clauses={
        "added": lambda rad: f"The controller sees the pole {abs(rad):g} rad too far {_right_or_left(rad)}",
        "scaled": lambda factor: f"The controller multiplies the rate of the lean by {factor:g}",
        "late": lambda lag: f"The controller sees the pole {lag:g} s late",
    },
)  # fmt: skip
HIGHWAY = Loop(
    directions={
        "accelerates more": ("acceleration", 1), "accelerates less": ("acceleration", -1),
        "steers further left": ("steering", 1), "steers further right": ("steering", -1),
    },
    actuators=("acceleration", "steering"),
    faster=(("acceleration", 1),),
    slower=(("acceleration", -1),),
    speed="speed",
    hazards={
        "hits another vehicle": lambda run: run["crashed"] > 0.5,
        "leaves the road": lambda run: run["on_road"] < 0.5,
    },
    terminal=("hits another vehicle", "leaves the road"),
    numbers={"hits another vehicle": (r"at (-?[0-9.]+) m/s", lambda run: float(run["closing"][-1]))},
    situation=lambda run: {"gap": run["gap"]},
    clauses={
        "added": lambda metres: (
            f"The controller measures {metres:g} m too much distance to the vehicle ahead"
        ),
        "scaled": lambda factor: f"The controller multiplies the closing speed by {factor:g}",
        "late": lambda lag: f"The desired heading arrives {lag:g} s late",
    },
)  # fmt: skip
OPENDBC = Loop(
    directions={"accelerates more": ("command", 1), "accelerates less": ("command", -1)},
    actuators=("command",),
    faster=(("command", 1),),
    slower=(("command", -1),),
    speed="speed",
    hazards={"hits the car ahead": lambda run: run["gap"] <= 0.0},
    terminal=("hits the car ahead",),
    numbers={
        "hits the car ahead": (
            r"at (-?[0-9.]+) m/s",
            lambda run: float((run["gap"][-2] - run["gap"][-1]) / (run["t"][-1] - run["t"][-2])),
        )
    },
    situation=lambda run: {"gap": run["gap"]},
    clauses={
        "added": lambda mps2: (
            f"The commanded acceleration is {abs(mps2):g} m/s^2 too {'high' if mps2 > 0.0 else 'low'}"
        ),
        "scaled": lambda factor: f"The wheel speed is multiplied by {factor:g}",
        "late": lambda lag: f"The measured speed arrives {lag:g} s late",
    },
)


def _right_or_left(number: float) -> str:
    return "right" if number > 0.0 else "left"
