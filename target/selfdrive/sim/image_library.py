"""The pictures a run drives through: a rendered road, or a folder of a user's frames. Grey, and read-only.

Pictures are made or decoded once and kept in a cache folder, in a file whose name is the digest of all they
follow from. Processes map that file and so share its memory. A file appears there whole or not at all.
Without a cache, or with one that cannot be written, each process makes its own.
"""

from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from hashlib import sha256
from io import SEEK_END, BytesIO
from pathlib import Path
from tempfile import NamedTemporaryFile

import cv2
import numpy as np

from selfdrive.common import camera_model
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim import image_folder, lead_picture, road_look, road_renderer, road_texture
from selfdrive.sim.image_folder import ImageFolder
from selfdrive.sim.picture import Picture
from selfdrive.sim.road_look import DASH_PERIOD
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.sim.vision import Pictures

FRAMES, PERIODS = 600, 66  # of the rendered road: 805.2 m, after which it repeats itself without a seam
SPACING = PERIODS * DASH_PERIOD / FRAMES  # m from frame to frame: 1.342, which is 20 a second at 60 mph
CHECK = np.dtype("<u8")  # a sum over all pixels ends the cache file

Frames = Iterator[np.ndarray]


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageLibrary:
    """Frames (number x rows x width, uint8) in the order they were taken, by `model`, each `spacing` m or,
    where that is None, 1 / `fps` s after the one before; the first follows the last.

    `digest` stands for all that the frames follow from.
    """

    name: str
    digest: str
    model: CameraModel
    frames: np.ndarray
    spacing: float | None
    fps: float | None

    def frame(self, t: float, position: float) -> Picture:
        """The picture at time `t` (s), after `position` m."""
        passed = t * self.fps if self.spacing is None else position / self.spacing
        number = int(passed + 1e-6) % len(self.frames)
        return Picture((self.digest, number), self.frames.shape[1:], lambda *_: self.frames[number])


def open_library(pictures: Pictures, seed: int) -> ImageLibrary:
    """The pictures a run asks for, from the cache where they are there. ConfigError for unusable frames."""
    cv2.setNumThreads(1)
    if pictures.frames is not None:
        return _own(ImageFolder(pictures.frames), pictures.cache)
    return _rendered(CameraModel(), pictures.marks, seed, pictures.cache)


def _rendered(model: CameraModel, marks: str, seed: int, cache: Path | None) -> ImageLibrary:
    made_by = (camera_model, lead_picture, road_look, road_renderer, road_texture)
    parts = [repr((marks, seed, astuple(model), FRAMES, PERIODS, cv2.__version__, np.__version__)).encode()]
    digest = _digest(parts + [Path(module.__file__).read_bytes() for module in made_by])

    def draw() -> Frames:
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


def cached(
    cache: Path | None, digest: str, shape: tuple[int, int, int], make: Callable[[], Frames]
) -> np.ndarray:
    """The frames `make` gives, as a read-only array of this shape.

    It is mapped from a file of the cache that is made where it is missing or damaged, by any number of
    processes at the same time. Without a cache that can be written the frames are made in memory.
    """
    frames = _kept(cache, digest, shape, make) if cache is not None else None
    return _in_memory(shape, make()) if frames is None else frames


def _kept(
    cache: Path, digest: str, shape: tuple[int, int, int], make: Callable[[], Frames]
) -> np.ndarray | None:
    """The frames in their file of the cache, made if need be; None where that cannot be."""
    path = cache / f"frames-{digest[:32]}.npy"
    try:
        frames = _mapped(path, shape)
        if frames is None:
            cache.mkdir(parents=True, exist_ok=True)
            _write(path, shape, make())
            frames = _mapped(path, shape)
    except OSError:
        return None
    return frames


def _in_memory(shape: tuple[int, int, int], made: Frames) -> np.ndarray:
    frames = np.empty(shape, np.uint8)
    for number, frame in enumerate(made):
        frames[number] = frame
    frames.flags.writeable = False
    return frames


def _write(path: Path, shape: tuple[int, int, int], frames: Frames) -> None:
    """Write all frames under another name, then give the file its own."""
    with NamedTemporaryFile(dir=path.parent, prefix=path.stem, suffix=".part", delete=False) as file:
        part = Path(file.name)
        try:
            file.write(_header(shape))
            total = 0
            for frame in frames:
                file.write(frame.tobytes())
                total += _sum(frame)
            file.write(_check(total))
            file.close()
            part.chmod(0o644)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def _mapped(path: Path, shape: tuple[int, int, int]) -> np.ndarray | None:
    """The frames in that file; None where there is no such file, or not a whole one."""
    header = _header(shape)
    end = len(header) + _size(shape)
    try:
        with path.open("rb") as file:
            begins = file.read(len(header))
            file.seek(0, SEEK_END)
            if begins != header or file.tell() != end + CHECK.itemsize:
                return None
            file.seek(end)
            check = file.read()
            frames = np.memmap(file, np.uint8, "r", len(header), shape)
    except FileNotFoundError:
        return None
    return frames.view(np.ndarray) if check == _check(_total(frames)) else None


def _header(shape: tuple[int, int, int]) -> bytes:
    """How NumPy's files of such an array begin."""
    header = BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "|u1", "fortran_order": False, "shape": shape})
    return header.getvalue()


def _total(frames: np.ndarray) -> int:
    """The sum of all frames' sums; of all at once where no frame ends within a word, which is quicker."""
    return _sum(frames) if frames[0].size % CHECK.itemsize == 0 else sum(map(_sum, frames))


def _sum(frame: np.ndarray) -> int:
    """A sum over the frame's bytes, taken eight at a time."""
    flat = frame.view(np.ndarray).reshape(-1)
    words = flat.size // CHECK.itemsize * CHECK.itemsize
    return int(flat[:words].view(CHECK).sum()) + int(flat[words:].sum())


def _check(total: int) -> bytes:
    """What ends a file whose frames have that sum; never all zeros where the frames are."""
    return ((total + 1) % 2**64).to_bytes(CHECK.itemsize, "little")


def _size(shape: tuple[int, int, int]) -> int:
    return shape[0] * shape[1] * shape[2]


def _digest(parts: list[bytes]) -> str:
    return sha256(b"".join(sha256(part).digest() for part in parts)).hexdigest()
