"""``sim-bridge render``: pictures and films of a flight from a file of poses, without a display."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import typer

from flightstack.core.atomic_file import check_new
from flightstack.core.errors import ConfigError
from flightstack.flight_log.poses_file import read_poses
from flightstack.params.vehicle import Vehicle, load_vehicle
from flightstack.process import console
from flightstack.process.command_line import PictureOptions
from sim_bridge import arguments
from sim_bridge.errors import UsageProblemError
from sim_bridge.render.cameras import CAMERAS
from sim_bridge.render.offscreen import choose_backend
from sim_bridge.render.poses import FlightPath

_MOST_FRAMES = 100_000
_SMALLEST_PX, _LARGEST_PX = 16, 4096
_MOST_PICTURES = 1000
_FILM_NAMES, _PICTURE_NAMES = (".mp4", ".gif"), (".png",)


def draw(poses: Path, options: PictureOptions, vehicle: str | None, caller: str) -> None:
    """Draw pictures or a film of a flight; errors name the command ``caller``."""
    with _errors_reported(caller):
        _render(poses, options, vehicle, caller)


def _render(poses: Path, options: PictureOptions, vehicle: str | None, caller: str) -> None:
    request = parse_request(options)
    is_mp4 = request.video is not None and request.video.suffix.lower() == ".mp4"
    arguments.require(caller.split(maxsplit=1)[-1], "PIL", *(["imageio_ffmpeg"] if is_mp4 else []))
    content = read_poses(poses)
    path = FlightPath(content)
    loaded = load_vehicle(vehicle or content.vehicle)
    first = path.begin_s if options.begin is None else _within("--from", options.begin, path)
    last = path.end_s if options.end is None else _within("--to", options.end, path)
    if first > last:
        raise UsageProblemError(f"--from {first:g}, --to {last:g}: the film would end before it begins")
    if options.view:
        from sim_bridge.render.viewer import play

        with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C closes the window
            play(loaded, path, first, last, request.speed, caller)
    if request.png or request.sheet or request.video:
        _write(request, loaded, path, first, last)


def _write(request: RenderRequest, vehicle: Vehicle, path: FlightPath, first: float, last: float) -> None:
    choose_backend()  # before MuJoCo is imported
    from sim_bridge.render.pictures import SHEET_PICTURES, Pictures, PictureStyle, film_of, numbered, spread

    times = [_within("--at", time_s, path) for time_s in request.times_s]
    if request.png is not None:
        for file in numbered(request.png, len(times) or 1):
            check_new(file, request.overwrite)
    film = None if request.video is None else film_of(request.video, first, last, request.fps, request.speed)
    if film is not None and film.frames > _MOST_FRAMES:
        raise UsageProblemError(
            f"the film would have {film.frames} frames: choose a smaller --fps or a part of it"
        )
    written: list[Path] = []
    with Pictures(
        vehicle, path, PictureStyle(request.camera, request.width, request.height, request.overlay)
    ) as pictures:
        if request.png is not None:
            written += pictures.write_pngs(request.png, times or [0.5 * (first + last)])
        if request.sheet is not None:
            pictures.write_sheet(request.sheet, times or spread(first, last, SHEET_PICTURES))
            written.append(request.sheet)
        if film is not None:
            pictures.write_film(film)
            written.append(film.path)
    for file in written:
        console.say(file)


_INTERRUPTED = 130
"""Exit code after Ctrl-C; as ``typer.Exit`` it would stand for an interrupt that was not reported."""


@contextlib.contextmanager
def _errors_reported(caller: str) -> Iterator[None]:
    """Report an error as one sentence of the called program; an unfinished file is removed."""
    program = caller.split(maxsplit=1)[0]
    try:
        yield
    except KeyboardInterrupt:
        console.complain(f"{program}: interrupted: the unfinished file is removed")
        raise SystemExit(_INTERRUPTED) from None
    except OSError as error:
        reason = error.strerror or (str(error).splitlines() or ["unknown reason"])[0]
        sentence, code = f"{error.filename or 'the pictures cannot be written'}: {reason}", 1
    except (UsageProblemError, ConfigError) as error:
        sentence, code = str(error), 2
    else:
        return
    console.complain(f"{program}: {sentence}")
    raise typer.Exit(code)


def _within(flag: str, time_s: float, path: FlightPath) -> float:
    begin, end = path.begin_s, path.end_s
    # accept rounded begin and end times
    if not begin - 0.01 <= time_s <= end + 0.01:
        raise UsageProblemError(f"{flag}: {time_s:g} s is outside the flight, {begin:g} to {end:g} s")
    return min(max(time_s, begin), end)


class RenderRequest(NamedTuple):
    """Requested pictures, checked as far as possible without the file of poses."""

    png: Path | None
    sheet: Path | None
    video: Path | None
    camera: str
    width: int
    height: int
    fps: float
    speed: float
    times_s: tuple[float, ...]
    overlay: bool
    overwrite: bool


def parse_request(options: PictureOptions) -> RenderRequest:
    """Return the checked request; raise UsageProblemError, ConfigError."""
    _check_conflicts(options)
    is_gif = options.video is not None and options.video.suffix.lower() == ".gif"
    width, height = _size(options.size or ("480x270" if is_gif else "1280x720"))
    fps = (12.5 if is_gif else 30.0) if options.fps is None else options.fps
    speed = 1.0 if options.speed is None else options.speed
    times_s = () if options.at is None else arguments.parse_times("--at", options.at, _MOST_PICTURES)
    request = RenderRequest(
        options.png, options.sheet, options.video, options.camera, width, height, fps, speed, times_s,
        not options.no_words, options.overwrite,
    )  # fmt: skip
    _check_request(request)
    return request


def _check_conflicts(options: PictureOptions) -> None:
    """Raise UsageProblemError for an option without effect, which may mean an unwanted long film."""
    if not (options.png or options.sheet or options.video or options.view):
        raise UsageProblemError("nothing to do: give --png, --sheet, --video or --view")
    film = options.video is not None or options.view
    if options.at is not None and not (options.png or options.sheet):
        raise UsageProblemError("--at is for --png and --sheet; --from and --to select a part of a film")
    for flag, value in (("--from", options.begin), ("--to", options.end)):
        if value is not None and not film and (options.sheet is None or options.at is not None):
            raise UsageProblemError(
                f"{flag} is for --video, --sheet and --view; --at selects the time of a picture"
            )
    if options.fps is not None and options.video is None:
        raise UsageProblemError("--fps is for --video")
    if options.speed is not None and not film:
        raise UsageProblemError("--speed is for --video and --view")


def _check_request(request: RenderRequest) -> None:
    for flag, file, endings in (
        ("--png", request.png, _PICTURE_NAMES), ("--sheet", request.sheet, _PICTURE_NAMES),
        ("--video", request.video, _FILM_NAMES),
    ):  # fmt: skip
        if file is None:
            continue
        if not file.name:
            raise UsageProblemError(
                f"{flag}: the file name is missing; it must end in {' or '.join(endings)}"
            )
        if file.suffix.lower() not in endings:
            raise UsageProblemError(f"{flag} {file}: the name must end in {' or '.join(endings)}")
        check_new(file, request.overwrite)
        if not file.parent.is_dir():
            raise UsageProblemError(f"{flag} {file}: there is no directory {file.parent}")
    if request.camera not in CAMERAS:
        raise UsageProblemError(f"--camera: {request.camera!r} is not one of {', '.join(CAMERAS)}")
    if (
        request.video is not None
        and request.video.suffix.lower() == ".mp4"
        and (request.width % 2 or request.height % 2)
    ):
        raise UsageProblemError(f"--size: an mp4 needs even numbers, not {request.width}x{request.height}")
    arguments.check_range("--fps", request.fps, 0.1, 240.0)
    arguments.check_range("--speed", request.speed, 1e-3, 1e3)


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", text)
    if found is None:
        raise UsageProblemError(f"--size: {text!r} is not WIDTHxHEIGHT in pixels, such as 1280x720")
    width, height = (int(number) for number in found.groups())
    for number in (width, height):
        arguments.check_range("--size", number, _SMALLEST_PX, _LARGEST_PX)
    return width, height
