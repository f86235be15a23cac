"""The camera's geometry: a pinhole over a flat road.

Car frame: x forward from the camera, y left, in m on the road. Picture: column u right, row v down, in
pixels. The camera is pitched down and has no roll or lens distortion.
"""

from dataclasses import dataclass
from math import atan, cos, sin, tan


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraModel:
    """A calibrated camera. Focal lengths and principal point in pixels, `height` in m, `pitch` in rad (down).

    The defaults are the published calibration of the Caltech lanes data set (M. Aly, 2008), at 640 x 480.
    """

    width: int = 640
    rows: int = 480
    fx: float = 309.4
    fy: float = 344.2
    cx: float = 317.9
    cy: float = 256.5
    height: float = 2.18
    pitch: float = 0.24434609527920614  # 14 degrees

    @property
    def horizon(self) -> float:
        return self.cy - self.fy * tan(self.pitch)

    def depth(self, row: float) -> float:
        """Distance (m) along the optical axis to the road in `row`, which must be below the horizon."""
        return self.height / (self._fall(row))

    def distance(self, row: float) -> float:
        """x (m) of the road in `row`, which must be below the horizon."""
        return (self.depth(row) - self.height * sin(self.pitch)) / cos(self.pitch)

    def row(self, x: float) -> float:
        """Row of the road `x` m ahead."""
        depth = x * cos(self.pitch) + self.height * sin(self.pitch)
        return self.horizon + self.fy * self.height / (depth * cos(self.pitch))

    def metres_per_pixel(self, row: float) -> float:
        """Width on the road (m) of a pixel in `row`, which must be below the horizon."""
        return self.depth(row) / self.fx

    def lines_divergence(self, width: float = 3.7) -> float:
        """Pixels per row by which two lines of the road, `width` m apart, diverge."""
        return self.fx * width * cos(self.pitch) / (self.fy * self.height)

    def column(self, x: float, y: float) -> float:
        return self.cx - self.fx * y / (x * cos(self.pitch) + self.height * sin(self.pitch))

    def project(self, x: float, y: float, z: float) -> tuple[float, float]:
        """(column, row) of the point `z` m above the road's (x, y), which must be ahead."""
        down = self.height - z
        depth = x * cos(self.pitch) + down * sin(self.pitch)
        fall = down * cos(self.pitch) - x * sin(self.pitch)
        return self.cx - self.fx * y / depth, self.cy + self.fy * fall / depth

    def line_in_picture(self, y: float, slope: float) -> tuple[float, float]:
        """(a, b) with u = a * v + b for the road's line y + slope * x; the inverse of `line_on_road`."""
        a = -self.fx * (y - slope * self.height * tan(self.pitch)) * cos(self.pitch) / (self.fy * self.height)
        return a, self.cx - self.fx * slope / cos(self.pitch) - a * self.horizon

    def line_on_road(self, a: float, b: float) -> tuple[float, float]:
        """(y, slope) of the road's line seen as u = a * v + b: `y` in m at x = 0, `slope` in m/m."""
        slope = (self.cx - a * self.horizon - b) * cos(self.pitch) / self.fx
        y = -a * self.fy * self.height / (self.fx * cos(self.pitch)) + slope * self.height * tan(self.pitch)
        return y, slope

    @classmethod
    def from_view(
        cls, *, width: int, rows: int, horizon: float, focal: float, height: float
    ) -> "CameraModel":
        """The camera with square pixels and its principal point in the picture's centre."""
        pitch = atan((0.5 * (rows - 1) - horizon) / focal)
        middle = 0.5 * (width - 1), 0.5 * (rows - 1)
        return cls(
            width=width, rows=rows, fx=focal, fy=focal, cx=middle[0], cy=middle[1], height=height, pitch=pitch
        )

    def _fall(self, row: float) -> float:
        return (row - self.horizon) * cos(self.pitch) / self.fy
