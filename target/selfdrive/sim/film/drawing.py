"""Colours, text and smooth shapes. Colours are BGR, positions (x, y) in pixels."""

import cv2
import numpy as np

Colour = tuple[int, int, int]

PAPER = (28, 24, 21)
PANEL = (40, 35, 31)
RULE = (74, 66, 60)
DIM = (160, 150, 142)
INK = (238, 234, 230)
GOLDEN = (224, 160, 76)  # blue and vermilion, distinguishable in grey and by colour-blind people
FAULTY = (62, 122, 240)
SEEN = (120, 232, 96)  # lane lines, as detected
DOUBTED = (60, 190, 250)  # lines with a low probability
PATH = (190, 200, 70)
TRIGGER = (200, 196, 192)
MANIFESTED = (150, 190, 60)
ALERT = (40, 178, 245)
HAZARD = (62, 52, 225)
COLOURS = (
    *(PAPER, PANEL, RULE, DIM, INK, GOLDEN, FAULTY, SEEN, DOUBTED),
    *(PATH, TRIGGER, MANIFESTED, ALERT, HAZARD),
)

DOUBTFUL = 0.5  # below this probability, lines are drawn as doubted
SMALL, NORMAL, LARGE = 0.42, 0.5, 0.66  # of text
SHIFT = 4  # fractional bits of OpenCV's coordinates
FAR = 1 << 14  # pixels; points further out are clipped

_FONT = cv2.FONT_HERSHEY_SIMPLEX


def line_colour(prob: float) -> Colour:
    return SEEN if prob >= DOUBTFUL else DOUBTED


def grey(canvas: np.ndarray) -> None:
    if canvas.size:
        canvas[:] = (0.7 * cv2.cvtColor(canvas, cv2.COLOR_BGR2GRAY)).astype(np.uint8)[..., None]


def write(
    canvas: np.ndarray,
    text: str,
    at: tuple[int, int],
    colour: Colour = INK,
    size: float = NORMAL,
    *,
    bold: bool = False,
) -> None:
    cv2.putText(canvas, text, at, _FONT, size, colour, 2 if bold else 1, cv2.LINE_AA)


def width(text: str, size: float = NORMAL, *, bold: bool = False) -> int:
    (columns, _), _ = cv2.getTextSize(text, _FONT, size, 2 if bold else 1)
    return columns


def shortened(text: str, room: int, size: float = NORMAL, *, bold: bool = False) -> str:
    if width(text, size, bold=bold) <= room:
        return text
    while text and width(text + "...", size, bold=bold) > room:
        text = text[:-1]
    return text.rstrip() + "..."


def tag(canvas: np.ndarray, text: str, at: tuple[int, int], colour: Colour) -> None:
    """Small text on a dark plate, with its baseline starting at `at`; readable on any picture."""
    x, y = at
    cv2.rectangle(canvas, (x - 4, y - 13), (x + width(text, SMALL) + 4, y + 5), PAPER, cv2.FILLED)
    write(canvas, text, at, colour, SMALL)


def chip(canvas: np.ndarray, text: str, at: tuple[int, int], fill: Colour, ink: Colour = PAPER) -> None:
    x, y = at
    cv2.rectangle(canvas, at, (x + width(text, bold=True) + 16, y + 22), fill, cv2.FILLED)
    write(canvas, text, (x + 8, y + 16), ink, bold=True)


def chip_width(text: str) -> int:
    return width(text, bold=True) + 16


def fill(canvas: np.ndarray, points: np.ndarray, colour: Colour) -> None:
    cv2.fillPoly(canvas, [_fixed(points)], colour, cv2.LINE_AA, SHIFT)


def stroke(canvas: np.ndarray, points: np.ndarray, colour: Colour, thickness: int = 1) -> None:
    cv2.polylines(canvas, [_fixed(points)], False, colour, thickness, cv2.LINE_AA, SHIFT)


def glaze(canvas: np.ndarray, points: np.ndarray, colour: Colour, share: float) -> None:
    layer = canvas.copy()
    fill(layer, points, colour)
    cv2.addWeighted(layer, share, canvas, 1.0 - share, 0.0, dst=canvas)


def _fixed(points: np.ndarray) -> np.ndarray:
    return np.round(np.clip(points, -FAR, FAR) * (1 << SHIFT)).astype(np.int32)
