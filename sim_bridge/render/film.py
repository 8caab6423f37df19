"""Picture files: PNG, sheets of pictures, GIF and MP4, each written atomically."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from PIL import Image

from flightstack.core.atomic_file import replacing, write_bytes_atomically

FILMS = (".mp4", ".gif")
PALETTE_FRAMES = 8
"""Number of frames that determine the palette of a GIF, before its first frame is written."""

_COLOURS = 255
_STRIP_SHARE = 6
_RARE_COLOURS = (
    (240, 200, 40), (230, 40, 160), (40, 120, 235), (235, 90, 25),
    (130, 180, 235), (250, 250, 250), (90, 90, 90), (20, 25, 32),
)  # fmt: skip
_SHEET_GAP_PX = 6
_GIF_TICK_S = 0.01
_GIF_SHORTEST_TICKS = 2  # players slow shorter frames down

FrameAt = Callable[[int], Image.Image]


def write_png(path: Path, image: Image.Image) -> None:
    """Write one picture; raise OSError."""
    buffer = io.BytesIO()
    image.save(buffer, "PNG", optimize=True)
    write_bytes_atomically(path, buffer.getvalue())


def sheet(images: Sequence[Image.Image]) -> Image.Image:
    """Return the pictures, all of one size, in a nearly square grid."""
    columns = math.ceil(math.sqrt(len(images)))
    rows = math.ceil(len(images) / columns)
    width, height = images[0].size
    step_x, step_y = width + _SHEET_GAP_PX, height + _SHEET_GAP_PX
    whole = Image.new("RGB", (columns * step_x - _SHEET_GAP_PX, rows * step_y - _SHEET_GAP_PX), "white")
    for index, image in enumerate(images):
        whole.paste(image, (index % columns * step_x, index // columns * step_y))
    return whole


def frames_to_draw(path: Path, count: int) -> int:
    """Return the number of pictures to draw for a film of ``count`` frames."""
    return count + min(PALETTE_FRAMES, count) if path.suffix.lower() == ".gif" else count


def write_film(path: Path, frame_at: FrameAt, count: int, fps: float) -> None:
    """Write a film of ``count`` frames in the format of its suffix, one of ``FILMS``; raise OSError."""
    with replacing(path) as temporary:
        (_write_gif if path.suffix.lower() == ".gif" else _write_mp4)(temporary, frame_at, count, fps)


def _write_mp4(path: Path, frame_at: FrameAt, count: int, fps: float) -> None:
    """Write H.264 with yuv420p, which every player supports; it needs even sizes."""
    import imageio_ffmpeg

    first = frame_at(0)
    writer: Any = imageio_ffmpeg.write_frames(
        str(path), first.size, fps=fps, codec="libx264", pix_fmt_in="rgb24", pix_fmt_out="yuv420p",
        macro_block_size=2, quality=None, output_params=["-crf", "21", "-movflags", "+faststart"],
        ffmpeg_log_level="error",
    )  # fmt: skip
    try:
        writer.send(None)
        writer.send(first.tobytes())
        for index in range(1, count):
            writer.send(frame_at(index).tobytes())
    finally:
        writer.close()
    if not path.exists() or not path.stat().st_size:
        raise OSError(0, "ffmpeg wrote nothing")


def _write_gif(path: Path, frame_at: FrameAt, count: int, fps: float) -> None:
    """Write all frames with one palette, so that colours do not flicker."""
    chosen = [frame_at(round(i * (count - 1) / PALETTE_FRAMES)) for i in range(min(PALETTE_FRAMES, count))]
    palette = _palette(chosen)
    flat = (frame_at(index).quantize(palette=palette, dither=Image.Dither.NONE) for index in range(count))
    next(flat).save(
        path, "GIF", save_all=True, append_images=flat, duration=gif_durations_ms(count, fps), loop=0
    )


def _palette(images: Sequence[Image.Image]) -> Image.Image:
    """Return an image with the palette of all images, and the colours of marks and text, which cover too few pixels."""
    pictures = sheet(images)
    strip = max(1, pictures.height // _STRIP_SHARE)
    whole = Image.new("RGB", (pictures.width, pictures.height + strip))
    whole.paste(pictures)
    for index, colour in enumerate(_RARE_COLOURS):
        begin, end = (pictures.width * place // len(_RARE_COLOURS) for place in (index, index + 1))
        whole.paste(colour, (begin, pictures.height, end, pictures.height + strip))
    return whole.quantize(_COLOURS, Image.Quantize.MEDIANCUT)


def gif_durations_ms(count: int, fps: float) -> list[int]:
    """Return the duration of each frame: a GIF counts in 0.01 s; rounding errors do not accumulate."""
    ends = [round(index / fps / _GIF_TICK_S) for index in range(count + 1)]
    return [10 * max(_GIF_SHORTEST_TICKS, end - begin) for begin, end in pairwise(ends)]
