"""Data for drawing a drive from above."""

from dataclasses import dataclass
from typing import Literal

ActorShape = Literal["box", "circle"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewedActor:
    """Something that moves. Formulas over channels give its centre (`x`, `y`) in m and `heading` (rad, left
    positive).

    `width` is the diameter of a circle. A `believed` actor is at the place that the controller assumes.
    """

    name: str
    shape: ActorShape
    length: float
    width: float
    x: str
    y: str
    heading: str
    visible: str
    believed: bool
    about: str


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundLine:
    """A line on the ground: points (x, y) in m, or a formula `y` for a line along x."""

    name: str
    points: tuple[tuple[float, float], ...]
    y: str
    dashed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class OverheadView:
    """The actors and lines of a drawing of the drive. `follow` is the actor that the view follows ('': none).
    `speed` is a formula for the speed (m/s) at which the origin moves along x.
    """

    actors: tuple[ViewedActor, ...]
    lines: tuple[GroundLine, ...]
    follow: str
    speed: str
