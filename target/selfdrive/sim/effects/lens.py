"""What sticks to the lens: it stays where it is in the picture, wherever the car drives."""

import cv2
import numpy as np

from selfdrive.sim.effects.effect import Effect, Scene
from selfdrive.sim.picture import Picture, Region

MUD_LEVEL = 45.0  # grey level of mud against the light
CLODS = 24.0, 8.0, 3.0  # px: sizes of its clods in a picture 640 wide
EDGE = 2.5  # px: blur of mud's edge, which is far out of focus
BLOB_LEVEL = 20.0
BLOB_RADII = 5.0, 50.0  # px
BLOB_BLUR = 7.0  # px


class _OnLens(Effect):
    """Something that covers a share of each pixel, the same in all pictures."""

    MOVING = False

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        part = region.part
        return cv2.add(cv2.multiply(picture[part], self._open[part], scale=1.0 / 255.0), self._dirt[part])

    def _cover(self, share: np.ndarray, levels: np.ndarray | float) -> None:
        self._open = np.rint(255.0 * (1.0 - share)).astype(np.uint8)
        self._dirt = np.rint(share * levels).astype(np.uint8)


class PaperOcclusion(_OnLens):
    """Dark, blurred, round blobs in random places below the horizon, as many as the amount says, of 5 to 50
    pixels' radius.

    The paper's text puts them anywhere; on the sky they would hide nothing that counts.
    """

    UNIT, LEAST, MOST, WHOLE = "blobs", 1, 10, True

    def _prepare(self, random: np.random.Generator) -> None:
        rows, columns = self.camera.rows, self.camera.width
        share = np.zeros((rows, columns), dtype=np.float32)
        # As many numbers for any amount: more blobs hold all of fewer.
        blobs = random.uniform(size=(self.MOST, 3))[: int(self.amount)]
        for column, row, size in blobs:
            radius = BLOB_RADII[0] + size * (BLOB_RADII[1] - BLOB_RADII[0])
            top = max(0.0, self.camera.horizon)
            centre = round(column * (columns - 1)), round(top + row * (rows - 1 - top))
            cv2.circle(share, centre, round(radius), 1.0, cv2.FILLED)
        self._cover(cv2.GaussianBlur(share, (0, 0), BLOB_BLUR), BLOB_LEVEL)


class LensMud(_OnLens):
    """Clods and spatters of mud over a share of the picture; more mud holds all of less."""

    UNIT, LEAST, MOST = "of the picture", 0.0, 0.95

    def _prepare(self, random: np.random.Generator) -> None:
        rows, columns = self.camera.rows, self.camera.width
        field = np.zeros((rows, columns), dtype=np.float32)
        for size in CLODS:
            sigma = size * columns / 640.0
            noise = random.standard_normal((rows, columns), dtype=np.float32)
            # Blurred white noise loses this factor in deviation: each size counts by its own.
            field += np.sqrt(size) * 2.0 * np.sqrt(np.pi) * sigma * cv2.GaussianBlur(noise, (0, 0), sigma)
        texture = random.standard_normal((rows, columns), dtype=np.float32)
        texture = MUD_LEVEL + 25.0 * cv2.GaussianBlur(texture, (0, 0), 1.5)
        self._cover(self._covered(field), np.clip(texture, 0.0, 255.0))

    def _covered(self, field: np.ndarray) -> np.ndarray:
        """Covered share of each pixel: mud lies where the field is highest."""
        threshold = np.quantile(field, 1.0 - self.amount)
        mud = (field > threshold).astype(np.float32)
        return cv2.GaussianBlur(mud, (0, 0), EDGE)
