"""The frames of a run, grey and read-only: a rendered road, or a folder of user frames.

Frames are rendered or decoded once and cached in a file named by the digest of all inputs, which processes
map and share. Files appear atomically, and each frame is checked on first use. Without a writable cache,
each process makes its frames in memory.
"""

from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from tempfile import NamedTemporaryFile

import cv2
import numpy as np

from selfdrive.common import camera_model
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim import image_folder, lead_picture, road_look, road_renderer, road_texture
from selfdrive.sim.image_folder import ImageFolder
from selfdrive.sim.picture import Picture
from selfdrive.sim.picture_options import Pictures
from selfdrive.sim.road_look import DASH_PERIOD
from selfdrive.sim.road_renderer import RoadRenderer

FRAMES, PERIODS = 600, 66  # of the rendered road, which repeats seamlessly after 805.2 m
SPACING = PERIODS * DASH_PERIOD / FRAMES  # m between frames: 1.342, for 20 frames per second at 60 mph
CHECK = 8  # bytes; the file ends with a check per frame, then a digest of these and the header
DIGEST = sha256().digest_size

Made = Iterator[np.ndarray]


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageLibrary:
    """Frames in order, taken by the camera `model`, each `spacing` m (or, if None, 1 / `fps` s) after the
    previous one; the first follows the last.

    `digest` covers all inputs of the frames.
    """

    name: str
    digest: str
    model: CameraModel
    frames: "Frames"
    spacing: float | None
    fps: float | None

    def frame(self, t: float, position: float) -> Picture:
        passed = t * self.fps if self.spacing is None else position / self.spacing
        number = int(passed + 1e-6) % len(self.frames)
        return Picture(
            (self.digest, number), self.frames.shape[1:], lambda region: self.frames[number][region.part]
        )


class Frames:
    """Frames (rows x width, uint8) by number, read-only; those from a file are verified on first use.

    `checks` has one check per frame, joined; it is empty for frames in memory. If a frame is damaged, `mend`
    recreates all frames.
    """

    def __init__(
        self, frames: np.ndarray, checks: bytes = b"", mend: "Callable[[], Frames] | None" = None
    ) -> None:
        self._frames, self._checks, self._mend = frames, checks, mend
        self._weights = _weights(frames.shape) if checks else None
        self._sound = np.full(len(frames), not checks)

    @property
    def shape(self) -> tuple[int, int, int]:
        return self._frames.shape

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, number: int) -> np.ndarray:
        if not self._sound[number]:
            self._verify(number)
        return self._frames[number]

    def _verify(self, number: int) -> None:
        expected = self._checks[number * CHECK : (number + 1) * CHECK]
        if _check(self._frames[number], self._weights) == expected:
            self._sound[number] = True
        else:
            mended = self._mend()
            self._frames, self._checks, self._mend = mended._frames, mended._checks, mended._mend
            self._sound = mended._sound
            self[number]


def open_library(pictures: Pictures, seed: int) -> ImageLibrary:
    """Open the frames of a run, cached if possible. Raises ConfigError for unusable frames."""
    cv2.setNumThreads(1)
    if pictures.frames is not None:
        return _own(ImageFolder(pictures.frames), pictures.cache)
    return _rendered(CameraModel(), pictures.marks, seed, pictures.cache)


def _rendered(model: CameraModel, marks: str, seed: int, cache: Path | None) -> ImageLibrary:
    made_by = (camera_model, lead_picture, road_look, road_renderer, road_texture)
    parts = [repr((marks, seed, astuple(model), FRAMES, PERIODS, cv2.__version__, np.__version__)).encode()]
    digest = _digest(parts + [Path(module.__file__).read_bytes() for module in made_by])

    def draw() -> Made:
        renderer = RoadRenderer(model, marks, seed, periods=PERIODS)
        return (renderer.grey(number * SPACING) for number in range(FRAMES))

    frames = cached(cache, digest, (FRAMES, model.rows, model.width), draw)
    name = f"rendered, {marks}"
    return ImageLibrary(name=name, digest=digest, model=model, frames=frames, spacing=SPACING, fps=None)


def _own(folder: ImageFolder, cache: Path | None) -> ImageLibrary:
    model = folder.model
    read_by = [Path(module.__file__).read_bytes() for module in (camera_model, image_folder)]
    digest = _digest([cv2.__version__.encode(), folder.digest.encode(), *read_by])
    shape = (len(folder.files), model.rows, model.width)
    return ImageLibrary(
        name=folder.name,
        digest=digest,
        model=model,
        frames=cached(cache, digest, shape, folder.read),
        spacing=folder.spacing,
        fps=folder.fps,
    )


def cached(cache: Path | None, digest: str, shape: tuple[int, int, int], make: Callable[[], Made]) -> Frames:
    """Return the frames from `make`, of this shape (number, rows, width).

    They are mapped from a cache file, which is created if missing or damaged, even by several processes at
    once. Without a writable cache, they are made in memory.
    """

    def in_memory() -> Frames:
        frames = np.empty(shape, np.uint8)
        for number, frame in enumerate(make()):
            frames[number] = frame
        frames.flags.writeable = False
        return Frames(frames)

    def anew() -> Frames:
        try:
            cache.mkdir(parents=True, exist_ok=True)
            _write(path, shape, make())
            found = _mapped(path, shape)
        except OSError:
            found = None
        return Frames(*found, in_memory) if found else in_memory()

    if cache is None:
        return in_memory()
    path = cache / f"frames-3-{digest[:32]}.npy"
    try:
        found = _mapped(path, shape)
    except OSError:
        return in_memory()
    return Frames(*found, anew) if found else anew()


def _write(path: Path, shape: tuple[int, int, int], frames: Made) -> None:
    with NamedTemporaryFile(dir=path.parent, prefix=path.stem, suffix=".part", delete=False) as file:
        part = Path(file.name)
        try:
            file.write(_header(shape))
            checks, weights = b"", _weights(shape)
            for frame in frames:
                file.write(frame.tobytes())
                checks += _check(frame, weights)
            file.write(checks + _seal(shape, checks))
            file.close()
            part.chmod(0o644)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def _mapped(path: Path, shape: tuple[int, int, int]) -> tuple[np.ndarray, bytes] | None:
    if path.is_fifo():  # reading a pipe would block
        return None
    header = _header(shape)
    end = len(header) + _size(shape)
    try:
        with path.open("rb") as file:
            begins = file.read(len(header))
            file.seek(end)
            checks, seal, more = file.read(shape[0] * CHECK), file.read(DIGEST), file.read(1)
            if begins != header or seal != _seal(shape, checks) or more:
                return None
            return np.memmap(file, np.uint8, "r", len(header), shape).view(np.ndarray), checks
    except FileNotFoundError:
        return None


def _header(shape: tuple[int, int, int]) -> bytes:
    header = BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "|u1", "fortran_order": False, "shape": shape})
    return header.getvalue()


def _seal(shape: tuple[int, int, int], checks: bytes) -> bytes:
    return sha256(_header(shape) + checks).digest()


def _weights(shape: tuple[int, int, int]) -> np.ndarray:
    words = -(-shape[1] * shape[2] // CHECK)
    return np.random.default_rng(0).integers(0, 2**64, words, np.uint64) | np.uint64(1)


def _check(frame: np.ndarray, weights: np.ndarray) -> bytes:
    """Weighted sum of a frame's words, five times as fast as SHA-256.

    It always detects a single changed word, and misses several changed words with a probability of 2^-32.
    """
    data = frame.reshape(-1)
    if data.size % CHECK:
        data = np.concatenate((data, np.zeros(-data.size % CHECK, np.uint8)))
    words = data.view(np.uint64)
    mixed = words >> np.uint64(32)
    mixed ^= words
    mixed *= weights
    return int(mixed.sum()).to_bytes(CHECK, "little")


def _size(shape: tuple[int, int, int]) -> int:
    return shape[0] * shape[1] * shape[2]


def _digest(parts: list[bytes]) -> str:
    return sha256(b"".join(sha256(part).digest() for part in parts)).hexdigest()
