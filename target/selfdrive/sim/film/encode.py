"""Writes pictures as H.264 in an .mp4, as an animated .gif, or as a still."""

from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np

from selfdrive.common.errors import ConfigError, writing
from selfdrive.sim.film import drawing

PICTURES_PER_S = 20  # as many as the camera takes, so a film has the speed of the run
PICTURES_PER_GIF_FRAME = 4  # a GIF has only every fourth picture, to limit its size
GIF_WIDTH = 800  # pixels, also to limit its size
GIF_COLOURS = 128  # half of what the format allows; compresses better
H264_OPTIONS = {"crf": "25", "preset": "veryfast"}
STILL_SUFFIXES = ".png", ".jpg"


def write_video(pictures: Iterable[np.ndarray], path: Path) -> None:
    """Write BGR pictures of one size, 50 ms each, to `path`. Raises ConfigError."""
    writers: dict[str, Callable[[Iterable[np.ndarray], Path], None]] = {
        ".mp4": _write_mp4,
        ".gif": _write_gif,
    }
    if path.suffix not in writers:
        raise ConfigError(
            f"a video {path.name}",
            expected=f"a name that ends in {' or '.join(writers)}",
            remedy="choose another --out",
        )
    with writing(path, expected="a writable file", remedy="choose another --out"):
        _create_empty_file(path)
        writers[path.suffix](pictures, path)


def write_still(picture: np.ndarray, path: Path) -> None:
    """Write one BGR picture to `path`, a .png or .jpg. Raises ConfigError."""
    if path.suffix not in STILL_SUFFIXES:
        raise ConfigError(
            f"a still {path.name}",
            expected=f"a name that ends in {' or '.join(STILL_SUFFIXES)}",
            remedy="choose another --out",
        )
    with writing(path, expected="a writable file", remedy="choose another --out"):
        _create_empty_file(path)
        path.write_bytes(cv2.imencode(path.suffix, picture)[1])


def _create_empty_file(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()


def _write_mp4(pictures: Iterable[np.ndarray], path: Path) -> None:
    import av  # stills do not need it

    with av.open(str(path), "w", options={"movflags": "faststart"}) as file:
        stream = None
        for picture in pictures:
            if stream is None:
                stream = file.add_stream("libx264", rate=PICTURES_PER_S, options=H264_OPTIONS)
                stream.height, stream.width = picture.shape[:2]
                stream.pix_fmt = "yuv420p"
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        if stream is not None:
            file.mux(stream.encode())


def _write_gif(pictures: Iterable[np.ndarray], path: Path) -> None:
    """Write fewer pictures with one palette: the sheet's own colours, then those of the middle picture."""
    from PIL import Image  # stills do not need it

    small = []
    for index, picture in enumerate(pictures):
        if index % PICTURES_PER_GIF_FRAME == 0:
            rows = round(picture.shape[0] * GIF_WIDTH / picture.shape[1])
            scaled = cv2.resize(picture, (GIF_WIDTH, rows), interpolation=cv2.INTER_AREA)
            small.append(Image.fromarray(cv2.cvtColor(scaled, cv2.COLOR_BGR2RGB)))
    sheet_colours = [part for colour in drawing.COLOURS for part in reversed(colour)]
    middle = small[len(small) // 2].quantize(GIF_COLOURS - len(drawing.COLOURS))
    palette = Image.new("P", (1, 1))
    palette.putpalette([*sheet_colours, *middle.getpalette()])
    indexed = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in small]
    duration = round(1000 * PICTURES_PER_GIF_FRAME / PICTURES_PER_S)
    indexed[0].save(path, save_all=True, append_images=indexed[1:], duration=duration, loop=0, optimize=False)
