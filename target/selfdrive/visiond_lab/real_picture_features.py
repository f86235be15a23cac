"""Makes rendered pictures look more real: adds verges, long shadows, bends and the faults of bad cameras."""

from collections.abc import Iterable

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel

MIN_BEND_RADIUS = 250.0  # m, radius of a curve
ROWS_BELOW_HORIZON = 4.0  # rows below it, where the road is assumed to end


class RandomVergesAndBands:
    """A verge that can begin directly at the lane, and darker or lighter bands along the road.

    Bands are shadows of barriers, strips of newer asphalt, gutters.
    """

    def __init__(self, model: CameraModel, lane_width: float, rng: np.random.Generator) -> None:
        rows = np.maximum(np.arange(model.rows), model.horizon + ROWS_BELOW_HORIZON)
        self._ahead = np.array([model.distance(row) for row in rows], np.float32)[:, np.newaxis]
        across = np.array([model.metres_per_pixel(row) for row in rows], np.float32)[:, np.newaxis]
        self._lateral = across * (np.float32(model.cx) - np.arange(model.width, dtype=np.float32))
        self._is_road = np.arange(model.rows)[:, np.newaxis] > model.horizon
        half = 0.5 * lane_width
        self._verges = [half + rng.gamma(2.0, 1.6) + 0.2 if rng.random() < 0.6 else 50.0 for _ in range(2)]
        self._verge_tone = rng.uniform(35.0, 200.0)
        self._verge_texture = self._draw_verge_texture(rng)
        self._bands = [_draw_band_values(rng) for _ in range(int(rng.integers(0, 5)))]

    def apply(
        self, picture: np.ndarray, paint: np.ndarray, offset: float, heading: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the picture of a road from that pose with verges and bands, and the remaining paint."""
        y = self._lateral + np.float32(heading) * self._ahead + np.float32(offset)
        tones = picture.astype(np.float32)
        for start, width, factor, soft in self._bands:
            cover = np.clip((y - start) / soft, 0.0, 1.0) * np.clip((start + width - y) / soft, 0.0, 1.0)
            tones *= 1.0 + (factor - 1.0) * np.where(self._is_road, cover, 0.0)
        left, right = self._verges
        grown = ((y > left) | (y < -right)) & self._is_road
        tones = np.where(grown, self._verge_texture, tones)
        return np.clip(tones, 0.0, 255.0).astype(np.uint8), np.where(grown, np.uint8(0), paint)

    def _draw_verge_texture(self, rng: np.random.Generator) -> np.ndarray:
        fine = rng.standard_normal(self._lateral.shape, dtype=np.float32)
        fine = cv2.GaussianBlur(fine, (0, 0), rng.uniform(0.6, 2.5), sigmaY=rng.uniform(0.6, 2.5))
        return self._verge_tone + fine * (rng.uniform(2.0, 40.0) / max(float(fine.std()), 1e-6))


def bend_road_in_images(
    model: CameraModel, images: Iterable[np.ndarray], rng: np.random.Generator
) -> list[np.ndarray]:
    bend = rng.uniform(-1.0, 1.0) ** 3 / MIN_BEND_RADIUS
    rows = np.maximum(np.arange(model.rows), model.horizon + ROWS_BELOW_HORIZON)
    shift = [0.5 * bend * model.distance(row) ** 2 / model.metres_per_pixel(row) for row in rows]
    column = np.arange(model.width, dtype=np.float32) + np.array(shift, np.float32)[:, np.newaxis]
    row = np.repeat(np.arange(model.rows, dtype=np.float32)[:, np.newaxis], model.width, axis=1)
    return [
        cv2.remap(image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for image in images
    ]


def degrade_like_bad_camera(picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Simulate a camera and file format: soft, noisy, compressed, with different contrast."""
    if rng.random() < 0.6:
        picture = cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.3, 1.6))
    tones = picture * rng.uniform(0.5, 1.3) + rng.uniform(-25.0, 60.0)
    if rng.random() < 0.7:
        tones += rng.standard_normal(picture.shape, dtype=np.float32) * rng.uniform(0.0, 6.0)
    picture = np.clip(tones, 0.0, 255.0).astype(np.uint8)
    if rng.random() < 0.6:
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(45, 97))]
        picture = cv2.imdecode(cv2.imencode(".jpg", picture, quality)[1], cv2.IMREAD_GRAYSCALE)
    return picture


def _draw_band_values(rng: np.random.Generator) -> tuple[float, float, float, float]:
    """A band's start (m left of the lane centre), width (m), factor on tones, and soft edge (m)."""
    return rng.uniform(-8.0, 6.0), rng.gamma(1.5, 1.5) + 0.3, rng.uniform(0.45, 1.3), rng.uniform(0.02, 0.4)
