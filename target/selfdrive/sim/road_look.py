"""The appearance of a rendered road: paint, asphalt, shadows, other cars.

Tones are grey levels (0..255) as the camera sees them; lengths in m; lateral positions are relative to the
centre of the ego lane, left positive.
"""

from dataclasses import dataclass, replace

DASH, DASH_PERIOD = 3.05, 12.2  # m: 10 ft painted every 40 ft (MUTCD, section 3A.06)
SOLID, DASHED = "solid", "dashed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Paint:
    """One line of paint. `wear` is the share that has flaked off, `fade` its loss of contrast.

    A `double` line is two strips with a gap of the same width.
    """

    tone: float = 218.0
    width: float = 0.12
    dashed: bool = False
    dash: float = DASH
    period: float = DASH_PERIOD
    phase: float = 0.0  # start of a dash along the road
    double: bool = False
    yellow: bool = False  # for colour pictures; its `tone` is grey
    wear: float = 0.06
    fade: float = 0.0  # 0 fresh .. 1 invisible


YELLOW_PAINT = Paint(tone=182.0, yellow=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherCar:
    """A vehicle at a fixed place ahead of the camera: its rear at `x`, its centre at `y`."""

    x: float
    y: float
    tone: float = 70.0
    width: float = 1.8
    height: float = 1.45


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """All variations between roads. The defaults are a clean highway in daylight.

    `left` and `right` bound the ego lane, `far_left` and `far_right` the adjacent lanes; None means no line.
    The shoulder begins outside the far lines, the verge outside the shoulder.
    """

    lane_width: float = 3.7
    left: Paint = YELLOW_PAINT
    right: Paint = Paint()
    far_left: Paint | None = Paint()
    far_right: Paint | None = Paint()
    # the ground
    asphalt: float = 97.0
    grain: float = 4.0  # standard deviation of the fine texture (grey levels)
    mottle: float = 3.0  # standard deviation of slow changes, over metres
    tracks: float = 5.0  # darkening in the wheel tracks
    shoulder: float = 88.0
    shoulder_width: float = 2.6
    verge: float = 78.0
    kerb: float | None = None  # tone of a kerb between shoulder and verge
    # flaws per 100 m of road
    patches: float = 1.0
    cracks: float = 2.0
    seams: float = 0.0  # tar seams that run along the road
    joints: float | None = None  # m between the joints across a concrete road
    joint_tone: float = -30.0  # of patches, cracks, seams and joints, relative to the ground
    # light
    shadows: float = 0.04  # share of the road in tree shadows
    shadow_depth: float = 0.3  # share of light lost in shadows
    sky: float = 222.0
    trees: float = 72.0
    exposure: float = 1.0  # factor on all tones
    cars: tuple[OtherCar, ...] = ()


def standard_look(marks: str = SOLID) -> Look:
    if marks not in (SOLID, DASHED):
        raise ValueError(f"marks: {marks!r}, expected {SOLID!r} or {DASHED!r}")
    look = Look()
    return replace(look, right=replace(look.right, dashed=marks == DASHED))
