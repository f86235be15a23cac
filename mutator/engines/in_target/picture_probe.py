"""A replacement for the probe in a tree that is run only to draw pictures. Standard library and numpy only.

At the place of an image effect, every effect in PICTURE_REQUEST is applied to the same picture, with the
variables of that place. The pictures before and after are written to the run's folder, and the run ends.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType, SimpleNamespace
from typing import Any

import numpy as np

# file, picture, effects, mutant: `review.effect_pictures` replaces the text of this call
PICTURE_REQUEST: dict[str, Any] = json.loads("{}")
PICTURES_FILE = "pictures.npz"

_output_folder = Path.cwd()
_remaining_observations = 0  # how many more observations the run can make
_has_drawn = False


def limit(max_steps: int) -> None:
    global _remaining_observations
    _remaining_observations = max_steps


def observe(**values: float) -> None:
    """Count a step; end the run when the pictures are drawn, or after too many steps."""
    global _remaining_observations
    _remaining_observations -= 1
    if _has_drawn or _remaining_observations < 0:
        raise SystemExit


def on() -> bool:
    return True


def call(fi: str, number: int) -> bool:
    return True


def every(fi: str, number: int) -> bool:
    return True


def active(fi: str) -> bool:
    """Draw the pictures at the first call, and end the run."""
    global _has_drawn
    if not _has_drawn:
        frame: FrameType | None = sys._getframe()
        while frame is not None and not frame.f_code.co_filename.endswith(PICTURE_REQUEST["file"]):
            frame = frame.f_back
        if frame is not None:
            _draw_before_and_after_effects({**frame.f_globals, **frame.f_locals})
            _has_drawn = True
            raise SystemExit
    return False


def _draw_before_and_after_effects(names: dict[str, Any]) -> None:
    before = _evaluate_picture(names)
    after = []
    for lines in PICTURE_REQUEST["effects"]:
        effect_names = {
            **names,
            "_fi": SimpleNamespace(on=on, call=call, every=every, active=_always_active, kept=_make_anew),
        }
        exec("\n".join(lines), effect_names)
        after.append(_evaluate_picture(effect_names))
        exec(
            f"{PICTURE_REQUEST['picture']} = _before", {**effect_names, "_before": before.copy()}
        )  # the picture can be an attribute
    np.savez(
        _output_folder / PICTURES_FILE,
        before=before,
        **{f"after_{i}": picture for i, picture in enumerate(after)},
    )


def _evaluate_picture(names: dict[str, Any]) -> Any:
    picture = eval(PICTURE_REQUEST["picture"], names)
    shape = tuple(getattr(picture, "shape", ()))
    kind = str(getattr(picture, "dtype", type(picture).__name__))
    if kind != "uint8" or len(shape) not in (2, 3) or shape[2:] not in ((), (3,)):
        raise TypeError(
            f"{PICTURE_REQUEST['picture']} is {kind} of shape {shape}, not a grey or RGB picture of bytes"
        )
    return np.array(picture)


def _always_active(fi: str) -> bool:
    return True


def _make_anew(fi: str, make: Callable[[], Any]) -> Any:
    return make()


def report() -> dict[str, Any]:
    return {"mutant": PICTURE_REQUEST["mutant"], "triggered": None, "injections": {}}
