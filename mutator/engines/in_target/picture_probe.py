"""A replacement for the probe in a tree that is run only to draw pictures. Standard library and numpy only.

At the place of an image effect, every effect in ASKED is applied to the same picture, with the variables of
that place. The pictures before and after are written to the run's folder, and the run
ends.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType, SimpleNamespace
from typing import Any

import numpy as np

ASKED: dict[str, Any] = json.loads("{}")  # file, picture, effects; filled in by `review.effect_pictures`
FILE = "pictures.npz"

_folder = Path.cwd()
_left = 0  # how many more observations the run can make
_drawn = False


def limit(max_steps: int) -> None:
    global _left
    _left = max_steps


def observe(**values: float) -> None:
    """Count a step; end the run when the pictures are drawn, or after too many steps."""
    global _left
    _left -= 1
    if _drawn or _left < 0:
        raise SystemExit


def on() -> bool:
    return True


def call(fi: str, number: int) -> bool:
    return True


def every(fi: str, number: int) -> bool:
    return True


def active(fi: str) -> bool:
    """Draw the pictures at the first call, and end the run."""
    global _drawn
    if not _drawn:
        frame: FrameType | None = sys._getframe()
        while frame is not None and not frame.f_code.co_filename.endswith(ASKED["file"]):
            frame = frame.f_back
        if frame is not None:
            _draw({**frame.f_globals, **frame.f_locals})
            _drawn = True
            raise SystemExit
    return False


def _draw(names: dict[str, Any]) -> None:
    before = _picture(names)
    after = []
    for lines in ASKED["effects"]:
        own = {**names, "_fi": SimpleNamespace(on=on, call=call, every=every, active=_yes, kept=_made)}
        exec("\n".join(lines), own)
        after.append(_picture(own))
        exec(
            f"{ASKED['picture']} = _before", {**own, "_before": before.copy()}
        )  # the picture can be an attribute
    np.savez(_folder / FILE, before=before, **{f"after_{i}": one for i, one in enumerate(after)})


def _picture(names: dict[str, Any]) -> Any:
    picture = eval(ASKED["picture"], names)
    shape = tuple(getattr(picture, "shape", ()))
    kind = str(getattr(picture, "dtype", type(picture).__name__))
    if kind != "uint8" or len(shape) not in (2, 3) or shape[2:] not in ((), (3,)):
        raise TypeError(f"{ASKED['picture']} is {kind} of shape {shape}, not a grey or RGB picture of bytes")
    return np.array(picture)


def _yes(fi: str) -> bool:
    return True


def _made(fi: str, make: Callable[[], Any]) -> Any:
    return make()


def report() -> dict[str, Any]:
    return {"mutant": ASKED["mutant"], "triggered": None, "injections": {}}
