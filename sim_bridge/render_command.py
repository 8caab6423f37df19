"""``sim-bridge render``: pictures and films of a flight, from a file of poses, without a screen."""

from __future__ import annotations

import contextlib
import re
import signal
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from sim_bridge import arguments
from sim_bridge.errors import UsageProblemError

if TYPE_CHECKING:
    from flightstack.params.vehicle import Vehicle
    from sim_bridge.multibody.poses import FlightPath

_SMALLEST_PX, _LARGEST_PX = 16, 4096
_MOST_FRAMES = 100_000
_MOST_PICTURES = 1000


_FILM_NAMES, _PICTURE_NAMES = (".mp4", ".gif"), (".png",)


class _Wish(NamedTuple):
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


def require(what: str, *modules: str) -> None:
    """Raise UsageProblemError when a module of the extra ``multibody`` is not installed."""
    if any(find_spec(module) is None for module in ("mujoco", *modules)):
        raise UsageProblemError(f"{what} needs MuJoCo: pip install 'flightstack[multibody]'")


def render(
    poses: Annotated[Path, typer.Argument(help="File of poses (.npz), as gcs replay writes it.")],
    png: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a picture.")] = None,
    sheet: Annotated[Path | None, typer.Option(metavar="FILE", help="Write several in one picture.")] = None,
    video: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a film, .mp4 or .gif.")] = None,
    view: Annotated[bool, typer.Option("--view", help="Play it in a window.")] = False,
    at: Annotated[
        str | None,
        typer.Option(metavar="T1[,T2,…]", help="Moments of the pictures, s; several give numbered files."),
    ] = None,
    camera: Annotated[str, typer.Option(help="chase, fixed, top or side.")] = "chase",
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="Pixels.  [default: 1280x720; 480x270 for a gif]")
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Frames per second.  [default: 30; 12.5 for a gif]")
    ] = None,
    begin: Annotated[float | None, typer.Option("--from", help="Begin of the film, s.")] = None,
    end: Annotated[float | None, typer.Option("--to", help="End of the film, s.")] = None,
    speed: Annotated[float, typer.Option(help="Show it so many times as fast as it was flown.")] = 1.0,
    vehicle: Annotated[str | None, typer.Option(help="Vehicle to draw.  [default: the file's]")] = None,
    no_words: Annotated[bool, typer.Option("--no-words", help="Leave out the figures.")] = False,
) -> None:
    """Draw pictures or a film of a flight."""
    if not (png or sheet or video or view):
        raise UsageProblemError("nothing to do: give --png, --sheet, --video or --view")
    is_gif = video is not None and video.suffix.lower() == ".gif"
    width, height = _size(size or ("480x270" if is_gif else "1280x720"))
    rate = (12.5 if is_gif else 30.0) if fps is None else fps
    wish = _Wish(png, sheet, video, camera, width, height, rate, speed, _times(at), not no_words)
    _check(wish)
    require("sim-bridge render", "PIL", *(["imageio_ffmpeg"] if video and not is_gif else []))
    from flightstack.params.vehicle import load_vehicle  # noqa: PLC0415
    from flightstack.poses_file import read_poses  # noqa: PLC0415
    from sim_bridge.multibody.poses import FlightPath  # noqa: PLC0415

    content = read_poses(poses)
    path = FlightPath(content)
    loaded = load_vehicle(vehicle or content.vehicle)
    first = path.begin_s if begin is None else _within("--from", begin, path)
    last = path.end_s if end is None else _within("--to", end, path)
    if first > last:
        raise UsageProblemError(f"--from {first:g}, --to {last:g}: the film would end before it begins")
    with _orderly():
        if view:
            from sim_bridge.multibody.viewer import play  # noqa: PLC0415

            with contextlib.suppress(KeyboardInterrupt):  # one way of closing the window
                play(loaded, path, first, last, speed)
        if png or sheet or video:
            _write(wish, loaded, path, first, last)


def _write(wish: _Wish, vehicle: Vehicle, path: FlightPath, first: float, last: float) -> None:
    from sim_bridge.multibody.offscreen import choose  # noqa: PLC0415

    choose()
    from sim_bridge.multibody.pictures import SHEET_PICTURES, Look, Pictures, film_of, spread  # noqa: PLC0415

    times = [_within("--at", time_s, path) for time_s in wish.times_s]
    film = None if wish.video is None else film_of(wish.video, first, last, wish.fps, wish.speed)
    if film is not None and film.frames > _MOST_FRAMES:
        raise UsageProblemError(
            f"the film would have {film.frames} frames: choose a smaller --fps or a part of it"
        )
    written: list[Path] = []
    with Pictures(vehicle, path, Look(wish.camera, wish.width, wish.height, wish.words)) as pictures:
        if wish.png is not None:
            written += pictures.write_pngs(wish.png, times or [0.5 * (first + last)])
        if wish.sheet is not None:
            pictures.write_sheet(wish.sheet, times or spread(first, last, SHEET_PICTURES))
            written.append(wish.sheet)
        if film is not None:
            pictures.write_film(film)
            written.append(film.path)
    for file in written:
        print(file)


@contextlib.contextmanager
def _orderly() -> Iterator[None]:
    """End with one sentence when the user stops or a file cannot be written; no half file stays."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    except KeyboardInterrupt:
        print("sim-bridge: interrupted: the file that was being made is gone", file=sys.stderr)
        raise typer.Exit(1) from None
    except OSError as error:
        reason = error.strerror or (str(error).splitlines() or ["unknown reason"])[0]
        print(f"sim-bridge: the pictures cannot be written: {reason}", file=sys.stderr)
        raise typer.Exit(1) from None


def _check(wish: _Wish) -> None:
    from sim_bridge.multibody.cameras import CAMERAS  # noqa: PLC0415

    for flag, file, endings in (
        ("--png", wish.png, _PICTURE_NAMES), ("--sheet", wish.sheet, _PICTURE_NAMES),
        ("--video", wish.video, _FILM_NAMES),
    ):  # fmt: skip
        if file is None:
            continue
        if file.suffix.lower() not in endings:
            raise UsageProblemError(f"{flag} {file}: the name must end in {' or '.join(endings)}")
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


def _times(text: str | None) -> tuple[float, ...]:
    return () if text is None else arguments.numbers("--at", text, tuple(range(1, _MOST_PICTURES + 1)))


def _within(flag: str, time_s: float, path: FlightPath) -> float:
    begin, end = path.begin_s, path.end_s
    # a time as it is shown, rounded, is meant to be the first or the last one
    if not begin - 0.01 <= time_s <= end + 0.01:
        raise UsageProblemError(f"{flag}: {time_s:g} s is outside the flight, {begin:g} to {end:g} s")
    return min(max(time_s, begin), end)
