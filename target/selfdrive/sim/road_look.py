"""The appearance of a rendered road: paint, asphalt, shadows, other cars.

Tones are grey levels (0..255) as the camera sees them; lengths in m; lateral positions are relative to the
centre of the ego lane, left positive.
"""

from dataclasses import dataclass, replace

DASH_LENGTH, DASH_PERIOD = 3.05, 12.2  # m: 10 ft painted every 40 ft (MUTCD, section 3A.06)
SOLID, DASHED = "solid", "dashed"


@dataclass(frozen=True, slots=True, kw_only=True)
class LinePaint:
    """One line of paint. `wear` is the share that has flaked off, `fade` its loss of contrast.

    A `double` line is two strips with a gap of the same width.
    """

    tone: float = 218.0
    width: float = 0.12
    dashed: bool = False
    dash: float = DASH_LENGTH
    period: float = DASH_PERIOD
    phase: float = 0.0  # start of a dash along the road
    double: bool = False
    yellow: bool = False  # for colour pictures; its `tone` is grey
    wear: float = 0.06
    fade: float = 0.0  # 0 fresh .. 1 invisible


YELLOW_PAINT = LinePaint(tone=182.0, yellow=True)  # darker than white in a grey picture


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherCar:
    """A vehicle at a fixed place ahead of the camera: its rear at `x`, its centre at `y`."""

    x: float
    y: float
    tone: float = 70.0
    width: float = 1.8
    height: float = 1.45


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadLook:
    """All variations between roads. The defaults are a clean highway in daylight.

    `left` and `right` bound the ego lane, `far_left` and `far_right` the adjacent lanes; None means no line.
    The shoulder begins outside the far lines, the verge outside the shoulder.
    """

    lane_width: float = 3.7
    left: LinePaint = YELLOW_PAINT
    right: LinePaint = LinePaint()
    far_left: LinePaint | None = LinePaint()
    far_right: LinePaint | None = LinePaint()
    # the ground
    asphalt_tone: float = 97.0
    grain: float = 4.0  # standard deviation of the fine texture (grey levels)
    mottle: float = 3.0  # standard deviation of slow changes, over metres
    wheel_track_darkening: float = 5.0  # darkening in the wheel tracks
    shoulder_tone: float = 88.0
    shoulder_width: float = 2.6
    verge_tone: float = 78.0
    kerb_tone: float | None = None  # tone of a kerb between shoulder and verge
    # flaws per 100 m of road
    patches_per_100_m: float = 1.0
    cracks_per_100_m: float = 2.0
    seams_per_100_m: float = 0.0  # tar seams that run along the road
    joint_spacing: float | None = None  # m between the joints across a concrete road
    joint_tone: float = -30.0  # of patches, cracks, seams and joints, relative to the ground
    # light
    shadow_share: float = 0.04  # share of the road in tree shadows
    shadow_depth: float = 0.3  # share of light lost in shadows
    sky_tone: float = 222.0
    trees_tone: float = 72.0
    exposure: float = 1.0  # factor on all tones
    cars: tuple[OtherCar, ...] = ()


def standard_look(marks: str = SOLID) -> RoadLook:
    if marks not in (SOLID, DASHED):
        raise ValueError(f"marks: {marks!r}, expected {SOLID!r} or {DASHED!r}")
    look = RoadLook()
    return replace(look, right=replace(look.right, dashed=marks == DASHED))
