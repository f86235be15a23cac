"""Colours, text and smooth shapes. Colours are BGR, positions (x, y) in pixels."""

import cv2
import numpy as np

Colour = tuple[int, int, int]

# The background is dark, as road pictures mostly are, so that lines and labels stand out.
PAPER = (28, 24, 21)
PANEL = (40, 35, 31)
RULE = (74, 66, 60)
DIM = (160, 150, 142)
INK = (238, 234, 230)
GOLDEN = (224, 160, 76)  # blue and vermilion, distinguishable in grey and by colour-blind people
FAULTY = (62, 122, 240)
DETECTED = (120, 232, 96)  # lane lines, as detected
UNCERTAIN = (60, 190, 250)  # lines with a low probability
PATH = (190, 200, 70)
TRIGGER = (200, 196, 192)
MANIFESTED = (150, 190, 60)
ALERT = (40, 178, 245)
HAZARD = (62, 52, 225)
COLOURS = (
    *(PAPER, PANEL, RULE, DIM, INK, GOLDEN, FAULTY, DETECTED, UNCERTAIN),
    *(PATH, TRIGGER, MANIFESTED, ALERT, HAZARD),
)

MIN_CERTAIN_PROBABILITY = 0.5  # below this probability, lines are drawn as doubted
SMALL_TEXT, NORMAL_TEXT, LARGE_TEXT = 0.42, 0.5, 0.66  # of text
FRACTION_BITS = 4  # fractional bits of OpenCV's coordinates
MOST_PIXELS_AWAY = 1 << 14  # pixels; points further out are clipped

_FONT = cv2.FONT_HERSHEY_SIMPLEX


def line_colour(prob: float) -> Colour:
    return DETECTED if prob >= MIN_CERTAIN_PROBABILITY else UNCERTAIN


def grey_out(canvas: np.ndarray) -> None:
    if canvas.size:
        canvas[:] = (0.7 * cv2.cvtColor(canvas, cv2.COLOR_BGR2GRAY)).astype(np.uint8)[..., None]


def write_text(
    canvas: np.ndarray,
    text: str,
    at: tuple[int, int],
    colour: Colour = INK,
    size: float = NORMAL_TEXT,
    *,
    bold: bool = False,
) -> None:
    cv2.putText(canvas, text, at, _FONT, size, colour, 2 if bold else 1, cv2.LINE_AA)


def text_width(text: str, size: float = NORMAL_TEXT, *, bold: bool = False) -> int:
    (columns, _), _ = cv2.getTextSize(text, _FONT, size, 2 if bold else 1)
    return columns


def shorten_text(text: str, most_pixels: int, size: float = NORMAL_TEXT, *, bold: bool = False) -> str:
    if text_width(text, size, bold=bold) <= most_pixels:
        return text
    while text and text_width(text + "...", size, bold=bold) > most_pixels:
        text = text[:-1]
    return text.rstrip() + "..."


def draw_tag(canvas: np.ndarray, text: str, at: tuple[int, int], colour: Colour) -> None:
    """Small text on a dark plate, with its baseline starting at `at`; readable on any picture."""
    x, y = at
    cv2.rectangle(canvas, (x - 4, y - 13), (x + text_width(text, SMALL_TEXT) + 4, y + 5), PAPER, cv2.FILLED)
    write_text(canvas, text, at, colour, SMALL_TEXT)


def draw_chip(canvas: np.ndarray, text: str, at: tuple[int, int], fill: Colour, ink: Colour = PAPER) -> None:
    x, y = at
    cv2.rectangle(canvas, at, (x + text_width(text, bold=True) + 16, y + 22), fill, cv2.FILLED)
    write_text(canvas, text, (x + 8, y + 16), ink, bold=True)


def chip_width(text: str) -> int:
    return text_width(text, bold=True) + 16


def fill_polygon(canvas: np.ndarray, points: np.ndarray, colour: Colour) -> None:
    cv2.fillPoly(canvas, [_to_fixed_point(points)], colour, cv2.LINE_AA, FRACTION_BITS)


def draw_polyline(canvas: np.ndarray, points: np.ndarray, colour: Colour, thickness: int = 1) -> None:
    cv2.polylines(canvas, [_to_fixed_point(points)], False, colour, thickness, cv2.LINE_AA, FRACTION_BITS)


def fill_translucent(canvas: np.ndarray, points: np.ndarray, colour: Colour, opacity: float) -> None:
    layer = canvas.copy()
    fill_polygon(layer, points, colour)
    cv2.addWeighted(layer, opacity, canvas, 1.0 - opacity, 0.0, dst=canvas)


def _to_fixed_point(points: np.ndarray) -> np.ndarray:
    return np.round(np.clip(points, -MOST_PIXELS_AWAY, MOST_PIXELS_AWAY) * (1 << FRACTION_BITS)).astype(
        np.int32
    )
