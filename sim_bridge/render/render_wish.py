"""What ``sim-bridge render`` was asked for: checked before anything is drawn or read."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from flightstack.core.atomic_file import check_new
from flightstack.process.command_line import PictureOptions
from sim_bridge import arguments
from sim_bridge.errors import UsageProblemError

_SMALLEST_PX, _LARGEST_PX = 16, 4096
_MOST_PICTURES = 1000
_FILM_NAMES, _PICTURE_NAMES = (".mp4", ".gif"), (".png",)


class Wish(NamedTuple):
    """What the user asked for, as far as it can be checked without the file."""

    png: Path | None
    sheet: Path | None
    video: Path | None
    camera: str
    width: int
    height: int
    fps: float
    speed: float
    times_s: tuple[float, ...]
    words: bool
    overwrite: bool


def wish_of(options: PictureOptions) -> Wish:
    """Check what was asked for as far as it can be without the file; raise UsageProblemError, ConfigError."""
    _check_company(options)
    is_gif = options.video is not None and options.video.suffix.lower() == ".gif"
    width, height = _size(options.size or ("480x270" if is_gif else "1280x720"))
    fps = (12.5 if is_gif else 30.0) if options.fps is None else options.fps
    speed = 1.0 if options.speed is None else options.speed
    times_s = () if options.at is None else arguments.times("--at", options.at, _MOST_PICTURES)
    wish = Wish(
        options.png, options.sheet, options.video, options.camera, width, height, fps, speed, times_s,
        not options.no_words, options.overwrite,
    )  # fmt: skip
    _check(wish)
    return wish


def _check_company(options: PictureOptions) -> None:
    """Refuse what would be without effect: nobody should wait for a whole film who has asked for a moment of it."""
    if not (options.png or options.sheet or options.video or options.view):
        raise UsageProblemError("nothing to do: give --png, --sheet, --video or --view")
    film = options.video is not None or options.view
    if options.at is not None and not (options.png or options.sheet):
        raise UsageProblemError("--at is for --png and --sheet: a part of a film is --from and --to")
    for flag, value in (("--from", options.begin), ("--to", options.end)):
        if value is not None and not film and (options.sheet is None or options.at is not None):
            raise UsageProblemError(
                f"{flag} is for --video, --sheet and --view: the moment of a picture is --at"
            )
    if options.fps is not None and options.video is None:
        raise UsageProblemError("--fps is for --video")
    if options.speed is not None and not film:
        raise UsageProblemError("--speed is for --video and --view")


def _check(wish: Wish) -> None:
    from sim_bridge.render.cameras import CAMERAS  # noqa: PLC0415

    for flag, file, endings in (
        ("--png", wish.png, _PICTURE_NAMES), ("--sheet", wish.sheet, _PICTURE_NAMES),
        ("--video", wish.video, _FILM_NAMES),
    ):  # fmt: skip
        if file is None:
            continue
        if not file.name:
            raise UsageProblemError(
                f"{flag}: the name of a file is missing; it must end in {' or '.join(endings)}"
            )
        if file.suffix.lower() not in endings:
            raise UsageProblemError(f"{flag} {file}: the name must end in {' or '.join(endings)}")
        check_new(file, wish.overwrite)
        if not file.parent.is_dir():
            raise UsageProblemError(f"{flag} {file}: there is no directory {file.parent}")
    if wish.camera not in CAMERAS:
        raise UsageProblemError(f"--camera: {wish.camera!r} is not one of {', '.join(CAMERAS)}")
    if wish.video is not None and wish.video.suffix.lower() == ".mp4" and (wish.width % 2 or wish.height % 2):
        raise UsageProblemError(f"--size: an mp4 needs even numbers, not {wish.width}x{wish.height}")
    arguments.in_range("--fps", wish.fps, 0.1, 240.0)
    arguments.in_range("--speed", wish.speed, 1e-3, 1e3)


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", text)
    if found is None:
        raise UsageProblemError(f"--size: {text!r} is not WIDTHxHEIGHT in pixels, such as 1280x720")
    width, height = (int(number) for number in found.groups())
    for number in (width, height):
        arguments.in_range("--size", number, _SMALLEST_PX, _LARGEST_PX)
    return width, height
