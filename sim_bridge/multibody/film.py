"""Files of pictures: PNG, a sheet of several, GIF and MP4. Each is there whole or not at all."""

from __future__ import annotations

import contextlib
import io
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from PIL import Image

from flightstack.atomic_file import write_bytes_atomically
from sim_bridge.errors import UsageProblemError

FILMS = (".mp4", ".gif")
_COLOURS = 255
_PALETTE_FRAMES = 12
_SHEET_GAP_PX = 6
_GIF_TICK_S = 0.01

Frames = Iterable[Image.Image]
Drawn = Callable[[], None]


def write_png(path: Path, image: Image.Image) -> None:
    """Write one picture; raise OSError."""
    buffer = io.BytesIO()
    image.save(buffer, "PNG", optimize=True)
    write_bytes_atomically(path, buffer.getvalue())


def sheet(images: Sequence[Image.Image]) -> Image.Image:
    """Return the pictures, all of one size, side by side in as square an order as can be."""
    columns = math.ceil(math.sqrt(len(images)))
    rows = math.ceil(len(images) / columns)
    width, height = images[0].size
    step_x, step_y = width + _SHEET_GAP_PX, height + _SHEET_GAP_PX
    whole = Image.new("RGB", (columns * step_x - _SHEET_GAP_PX, rows * step_y - _SHEET_GAP_PX), "white")
    for index, image in enumerate(images):
        whole.paste(image, (index % columns * step_x, index // columns * step_y))
    return whole


def write_film(path: Path, frames: Frames, fps: float) -> None:
    """Write a film by the ending of its name, one of ``FILMS``; raise OSError or UsageProblemError."""
    with _replacing(path) as temporary:
        (_write_gif if path.suffix.lower() == ".gif" else _write_mp4)(temporary, frames, fps)


@contextlib.contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """Give a name to write to, which becomes ``path`` at the end; nothing is left when something goes wrong."""
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix.lower()}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _write_mp4(path: Path, frames: Frames, fps: float) -> None:
    """H.264 with the colours that every player knows; the sides are even, as it needs them."""
    import imageio_ffmpeg  # noqa: PLC0415  # brings a program of its own

    writer: Any = None
    try:
        for frame in frames:
            if writer is None:
                writer = imageio_ffmpeg.write_frames(
                    str(path), frame.size, fps=fps, codec="libx264", pix_fmt_in="rgb24", pix_fmt_out="yuv420p",
                    macro_block_size=2, quality=None, output_params=["-crf", "21", "-movflags", "+faststart"],
                    ffmpeg_log_level="error",
                )  # fmt: skip
                writer.send(None)
            writer.send(frame.tobytes())
    finally:
        if writer is not None:
            writer.close()
    if not path.exists() or not path.stat().st_size:
        raise UsageProblemError(f"{path.name}: ffmpeg wrote nothing")


def _write_gif(path: Path, frames: Frames, fps: float) -> None:
    """One palette for all frames, taken from some of them, so that colours do not flicker."""
    images = list(frames)
    chosen = images[:: max(1, len(images) // _PALETTE_FRAMES)]
    palette = sheet([image.resize((160, 90)) for image in chosen]).quantize(
        _COLOURS, Image.Quantize.MEDIANCUT
    )
    flat = [image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG) for image in images]
    flat[0].save(
        path, "GIF", save_all=True, append_images=flat[1:], duration=gif_durations_ms(len(flat), fps), loop=0,
        optimize=False, disposal=1,
    )  # fmt: skip


def gif_durations_ms(count: int, fps: float) -> list[int]:
    """Return how long each frame stays: a GIF counts in hundredths of a second, the errors must not add up."""
    ends = [round(index / fps / _GIF_TICK_S) for index in range(count + 1)]
    return [10 * max(2, end - begin) for begin, end in pairwise(ends)]
