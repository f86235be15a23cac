"""Dirt on the lens, which stays in the same place in the picture."""

import cv2
import numpy as np

from selfdrive.sim.effects.effect import Effect, Scene
from selfdrive.sim.picture import Picture, Region

MUD_LEVEL = 45.0  # grey level of mud against light
CLOD_SIZES = 24.0, 8.0, 3.0  # px, clod sizes in a picture 640 wide
MUD_EDGE_BLUR = 2.5  # px, blur of the mud's edge, which is out of focus
BLOB_LEVEL = 20.0
BLOB_RADII = 5.0, 50.0  # px
BLOB_BLUR = 7.0  # px


class _OnLens(Effect):
    """Dirt that covers a share of each pixel, the same in all pictures."""

    MOVING = False

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        part = region.part
        return cv2.add(cv2.multiply(picture[part], self._open[part], scale=1.0 / 255.0), self._dirt[part])

    def _cover(self, share: np.ndarray, levels: np.ndarray | float) -> None:
        self._open = np.rint(255.0 * (1.0 - share)).astype(np.uint8)
        self._dirt = np.rint(share * levels).astype(np.uint8)


class PaperOcclusion(_OnLens):
    """Dark, blurred, round blobs in random places below the horizon, with radii of 5 to 50 pixels; the amount
    is their number.

    The paper's text allows any place, but blobs on the sky would hide nothing important.
    """

    UNIT, LEAST, MOST, WHOLE = "blobs", 1, 10, True

    def _prepare(self, random: np.random.Generator) -> None:
        rows, columns = self.camera.rows, self.camera.width
        share = np.zeros((rows, columns), dtype=np.float32)
        # The same random numbers for any amount, so that a higher amount has all blobs of a lower one.
        blobs = random.uniform(size=(self.MOST, 3))[: int(self.amount)]
        for column, row, size in blobs:
            radius = BLOB_RADII[0] + size * (BLOB_RADII[1] - BLOB_RADII[0])
            top = max(0.0, self.camera.horizon)
            centre = round(column * (columns - 1)), round(top + row * (rows - 1 - top))
            cv2.circle(share, centre, round(radius), 1.0, cv2.FILLED)
        self._cover(cv2.GaussianBlur(share, (0, 0), BLOB_BLUR), BLOB_LEVEL)


class LensMud(_OnLens):
    """Clods and spatters of mud over a share of the picture; higher amounts add mud to that of lower ones."""

    UNIT, LEAST, MOST = "of the picture", 0.0, 0.95

    def _prepare(self, random: np.random.Generator) -> None:
        rows, columns = self.camera.rows, self.camera.width
        field = np.zeros((rows, columns), dtype=np.float32)
        for size in CLOD_SIZES:
            sigma = size * columns / 640.0
            noise = random.standard_normal((rows, columns), dtype=np.float32)
            # Blurring white noise reduces its deviation by this factor, so that each size has its own weight.
            field += np.sqrt(size) * 2.0 * np.sqrt(np.pi) * sigma * cv2.GaussianBlur(noise, (0, 0), sigma)
        texture = random.standard_normal((rows, columns), dtype=np.float32)
        texture = MUD_LEVEL + 25.0 * cv2.GaussianBlur(texture, (0, 0), 1.5)
        self._cover(self._covered(field), np.clip(texture, 0.0, 255.0))

    def _covered(self, field: np.ndarray) -> np.ndarray:
        threshold = np.quantile(field, 1.0 - self.amount)
        mud = (field > threshold).astype(np.float32)
        return cv2.GaussianBlur(mud, (0, 0), MUD_EDGE_BLUR)
