"""What the pictures of a run show, how they follow the car, and which detector sees them."""

from dataclasses import dataclass
from pathlib import Path

DETECTORS = PAPER_DETECTOR, ROBUST_DETECTOR, AUTHORS_CODE_DETECTOR = "paper", "robust", "as_coded"
MARKS = SOLID_MARKS, DASHED_MARKS = "solid", "dashed"
TRANSLATIONS = GROUND_TRANSLATION, SHIFT_TRANSLATION, AUTHORS_CODE_TRANSLATION = "ground", "shift", "as_coded"


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureOptions:
    """The pictures of a run, and their detector.

    `frames` is a folder of user frames; None: a rendered road with these `marks` (both solid, or the right
    one dashed). `translation` is how frames follow the car's offset and heading: by the ground's homography,
    or by shifting, as in the paper's text or in its authors' code. `threshold` is the lowest log odds of a
    window with a mark, for the detector as coded; None: its own. The folder `cache` stores frames and
    detections; None: nothing is stored. With `forget`, stored detections are not used, as needed for
    detection code that depends on time.
    """

    detector: str = PAPER_DETECTOR
    marks: str = SOLID_MARKS
    frames: Path | None = None
    translation: str = GROUND_TRANSLATION
    threshold: float | None = None
    cache: Path | None = None
    ignore_stored: bool = False
