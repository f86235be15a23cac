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
from selfdrive.sim.picture_options import PictureOptions
from selfdrive.sim.road_look import DASH_PERIOD
from selfdrive.sim.road_renderer import RoadRenderer

RENDERED_FRAMES, RENDERED_PERIODS = 600, 66  # of the rendered road, which repeats seamlessly after 805.2 m
# m between frames: 1.342, for 20 frames per second at 60 mph
RENDERED_SPACING = RENDERED_PERIODS * DASH_PERIOD / RENDERED_FRAMES
FRAME_CHECK_BYTES = 8  # bytes; the file ends with a check per frame, then a digest of these and the header
DIGEST_BYTES = sha256().digest_size

FrameIterator = Iterator[np.ndarray]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameLibrary:
    """Frames in order, taken by the camera `model`, each `spacing` m (or, if None, 1 / `fps` s) after the
    previous one; the first follows the last.

    `digest` covers all inputs of the frames.
    """

    name: str
    digest: str
    model: CameraModel
    frames: "CheckedFrames"
    spacing: float | None
    fps: float | None

    def frame(self, t: float, position: float) -> Picture:
        passed = t * self.fps if self.spacing is None else position / self.spacing
        number = int(passed + 1e-6) % len(self.frames)
        return Picture(
            (self.digest, number), self.frames.shape[1:], lambda region: self.frames[number][region.part]
        )


class CheckedFrames:
    """Frames (rows x width, uint8) by number, read-only; those from a file are verified on first use.

    `checks` has one check per frame, joined; it is empty for frames in memory. If a frame is damaged, `mend`
    recreates all frames.
    """

    def __init__(
        self, frames: np.ndarray, checks: bytes = b"", mend: "Callable[[], CheckedFrames] | None" = None
    ) -> None:
        self._frames, self._checks, self._remake = frames, checks, mend
        self._weights = _check_sum_weights(frames.shape) if checks else None
        self._verified = np.full(len(frames), not checks)

    @property
    def shape(self) -> tuple[int, int, int]:
        return self._frames.shape

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, number: int) -> np.ndarray:
        if not self._verified[number]:
            self._verify(number)
        return self._frames[number]

    def _verify(self, number: int) -> None:
        expected = self._checks[number * FRAME_CHECK_BYTES : (number + 1) * FRAME_CHECK_BYTES]
        if _frame_check(self._frames[number], self._weights) == expected:
            self._verified[number] = True
        else:
            remade = self._remake()
            self._frames, self._checks, self._remake = remade._frames, remade._checks, remade._remake
            self._verified = remade._verified
            self[number]


def open_frame_library(pictures: PictureOptions, seed: int) -> FrameLibrary:
    """Open the frames of a run, cached if possible. Raises ConfigError for unusable frames."""
    cv2.setNumThreads(1)
    if pictures.frames is not None:
        return _open_user_frames(ImageFolder(pictures.frames), pictures.cache)
    return _open_rendered_frames(CameraModel(), pictures.marks, seed, pictures.cache)


def _open_rendered_frames(model: CameraModel, marks: str, seed: int, cache: Path | None) -> FrameLibrary:
    rendering_modules = (camera_model, lead_picture, road_look, road_renderer, road_texture)
    parts = [
        repr(
            (marks, seed, astuple(model), RENDERED_FRAMES, RENDERED_PERIODS, cv2.__version__, np.__version__)
        ).encode()
    ]
    digest = _digest_of_parts(parts + [Path(module.__file__).read_bytes() for module in rendering_modules])

    def draw() -> FrameIterator:
        renderer = RoadRenderer(model, marks, seed, periods=RENDERED_PERIODS)
        return (renderer.render_grey(number * RENDERED_SPACING) for number in range(RENDERED_FRAMES))

    frames = map_or_make_frames(cache, digest, (RENDERED_FRAMES, model.rows, model.width), draw)
    name = f"rendered, {marks}"
    return FrameLibrary(
        name=name, digest=digest, model=model, frames=frames, spacing=RENDERED_SPACING, fps=None
    )


def _open_user_frames(folder: ImageFolder, cache: Path | None) -> FrameLibrary:
    model = folder.model
    reading_modules = [Path(module.__file__).read_bytes() for module in (camera_model, image_folder)]
    digest = _digest_of_parts([cv2.__version__.encode(), folder.digest.encode(), *reading_modules])
    shape = (len(folder.frame_paths), model.rows, model.width)
    return FrameLibrary(
        name=folder.name,
        digest=digest,
        model=model,
        frames=map_or_make_frames(cache, digest, shape, folder.decode_frames),
        spacing=folder.spacing,
        fps=folder.fps,
    )


def map_or_make_frames(
    cache: Path | None, digest: str, shape: tuple[int, int, int], make: Callable[[], FrameIterator]
) -> CheckedFrames:
    """Return the frames from `make`, of this shape (number, rows, width).

    They are mapped from a cache file, which is created if missing or damaged, even by several processes at
    once. Without a writable cache, they are made in memory.
    """

    def make_in_memory() -> CheckedFrames:
        frames = np.empty(shape, np.uint8)
        for number, frame in enumerate(make()):
            frames[number] = frame
        frames.flags.writeable = False
        return CheckedFrames(frames)

    def make_in_file() -> CheckedFrames:
        try:
            cache.mkdir(parents=True, exist_ok=True)
            _write_cache_file(path, shape, make())
            mapped = _map_cache_file(path, shape)
        except OSError:
            mapped = None
        return CheckedFrames(*mapped, make_in_memory) if mapped else make_in_memory()

    if cache is None:
        return make_in_memory()
    path = cache / f"frames-3-{digest[:32]}.npy"
    try:
        mapped_frames = _map_cache_file(path, shape)
    except OSError:
        return make_in_memory()
    return CheckedFrames(*mapped_frames, make_in_file) if mapped_frames else make_in_file()


def _write_cache_file(path: Path, shape: tuple[int, int, int], frames: FrameIterator) -> None:
    with NamedTemporaryFile(dir=path.parent, prefix=path.stem, suffix=".part", delete=False) as file:
        part = Path(file.name)
        try:
            file.write(_npy_header(shape))
            checks, weights = b"", _check_sum_weights(shape)
            for frame in frames:
                file.write(frame.tobytes())
                checks += _frame_check(frame, weights)
            file.write(checks + _checks_digest(shape, checks))
            file.close()
            part.chmod(0o644)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def _map_cache_file(path: Path, shape: tuple[int, int, int]) -> tuple[np.ndarray, bytes] | None:
    if path.is_fifo():  # reading a pipe would block
        return None
    header = _npy_header(shape)
    end = len(header) + _pixel_count(shape)
    try:
        with path.open("rb") as file:
            begins = file.read(len(header))
            file.seek(end)
            checks, seal, more = (
                file.read(shape[0] * FRAME_CHECK_BYTES),
                file.read(DIGEST_BYTES),
                file.read(1),
            )
            if begins != header or seal != _checks_digest(shape, checks) or more:
                return None
            return np.memmap(file, np.uint8, "r", len(header), shape).view(np.ndarray), checks
    except FileNotFoundError:
        return None


def _npy_header(shape: tuple[int, int, int]) -> bytes:
    header = BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "|u1", "fortran_order": False, "shape": shape})
    return header.getvalue()


def _checks_digest(shape: tuple[int, int, int], checks: bytes) -> bytes:
    return sha256(_npy_header(shape) + checks).digest()


def _check_sum_weights(shape: tuple[int, int, int]) -> np.ndarray:
    words = -(-shape[1] * shape[2] // FRAME_CHECK_BYTES)
    return np.random.default_rng(0).integers(0, 2**64, words, np.uint64) | np.uint64(1)


def _frame_check(frame: np.ndarray, weights: np.ndarray) -> bytes:
    """Weighted sum of a frame's words, five times as fast as SHA-256.

    It always detects a single changed word, and misses several changed words with a probability of 2^-32.
    """
    data = frame.reshape(-1)
    if data.size % FRAME_CHECK_BYTES:
        data = np.concatenate((data, np.zeros(-data.size % FRAME_CHECK_BYTES, np.uint8)))
    words = data.view(np.uint64)
    mixed = words >> np.uint64(32)
    mixed ^= words
    mixed *= weights
    return int(mixed.sum()).to_bytes(FRAME_CHECK_BYTES, "little")


def _pixel_count(shape: tuple[int, int, int]) -> int:
    return shape[0] * shape[1] * shape[2]


def _digest_of_parts(parts: list[bytes]) -> str:
    return sha256(b"".join(sha256(part).digest() for part in parts)).hexdigest()
