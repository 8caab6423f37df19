"""``sim-bridge render``: pictures and films of a flight, from a file of poses, without a screen."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flightstack.core.atomic_file import check_new
from flightstack.core.errors import INSTALL_MULTIBODY, ConfigError
from flightstack.process import command_line as asked
from flightstack.process import console
from sim_bridge.errors import UsageProblemError
from sim_bridge.render.render_wish import Wish, wish_of

if TYPE_CHECKING:
    from flightstack.params.vehicle import Vehicle
    from sim_bridge.render.poses import FlightPath

_MOST_FRAMES = 100_000
_NAME = "sim-bridge render"


def require(what: str, *modules: str) -> None:
    """Raise UsageProblemError when a module of the extra ``multibody`` is not installed."""
    if any(find_spec(module) is None for module in ("mujoco", *modules)):
        raise UsageProblemError(f"{what} needs MuJoCo: {INSTALL_MULTIBODY}")


def render(
    poses: Annotated[Path, typer.Argument(help="File of poses (.npz), as gcs replay writes it.")],
    png: asked.Png = None,
    sheet: asked.Sheet = None,
    video: asked.Video = None,
    view: asked.View = False,
    at: asked.At = None,
    camera: asked.Camera = "chase",
    size: asked.Size = None,
    fps: asked.Fps = None,
    begin: asked.Begin = None,
    end: asked.End = None,
    speed: asked.Speed = None,
    vehicle: Annotated[str | None, typer.Option(help="Vehicle to draw.  [default: the file's]")] = None,
    no_words: asked.NoWords = False,
    overwrite: asked.Overwrite = False,
    caller: Annotated[str, typer.Option(hidden=True, help="Command that complaints name.")] = _NAME,
) -> None:
    """Draw pictures or a film of a flight."""
    options = asked.PictureOptions(
        png, sheet, video, view, at, camera, size, fps, begin, end, speed, no_words, overwrite
    )
    with _orderly(caller):
        _render(poses, options, vehicle, caller)


def _render(poses: Path, options: asked.PictureOptions, vehicle: str | None, caller: str) -> None:
    wish = wish_of(options)
    is_mp4 = wish.video is not None and wish.video.suffix.lower() == ".mp4"
    require(caller.rsplit(maxsplit=1)[-1], "PIL", *(["imageio_ffmpeg"] if is_mp4 else []))
    from flightstack.flight_log.poses_file import read_poses  # noqa: PLC0415
    from flightstack.params.vehicle import load_vehicle  # noqa: PLC0415
    from sim_bridge.render.poses import FlightPath  # noqa: PLC0415

    content = read_poses(poses)
    path = FlightPath(content)
    loaded = load_vehicle(vehicle or content.vehicle)
    first = path.begin_s if options.begin is None else _within("--from", options.begin, path)
    last = path.end_s if options.end is None else _within("--to", options.end, path)
    if first > last:
        raise UsageProblemError(f"--from {first:g}, --to {last:g}: the film would end before it begins")
    if options.view:
        from sim_bridge.render.viewer import play  # noqa: PLC0415

        with contextlib.suppress(KeyboardInterrupt):  # one way of closing the window
            play(loaded, path, first, last, wish.speed, caller)
    if wish.png or wish.sheet or wish.video:
        _write(wish, loaded, path, first, last)


def _write(wish: Wish, vehicle: Vehicle, path: FlightPath, first: float, last: float) -> None:
    from sim_bridge.render.offscreen import choose  # noqa: PLC0415

    choose()
    from sim_bridge.render.pictures import SHEET_PICTURES, Look, Pictures, film_of, numbered, spread  # noqa: PLC0415

    times = [_within("--at", time_s, path) for time_s in wish.times_s]
    if wish.png is not None:
        for file in numbered(wish.png, len(times) or 1):
            check_new(file, wish.overwrite)
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
        console.say(file)


@contextlib.contextmanager
def _orderly(caller: str) -> Iterator[None]:
    """End with one sentence of the program that was called; no half file stays when it could not be finished."""
    program = caller.split(maxsplit=1)[0]
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    except KeyboardInterrupt:
        sentence, code = "interrupted: the file that was being made is gone", 1
    except OSError as error:
        reason = error.strerror or (str(error).splitlines() or ["unknown reason"])[0]
        sentence, code = f"the pictures cannot be written: {reason}", 1
    except (UsageProblemError, ConfigError) as error:
        sentence, code = str(error), 2
    else:
        return
    console.complain(f"{program}: {sentence}")
    raise typer.Exit(code)


def _within(flag: str, time_s: float, path: FlightPath) -> float:
    begin, end = path.begin_s, path.end_s
    # a time as it is shown, rounded, is meant to be the first or the last one
    if not begin - 0.01 <= time_s <= end + 0.01:
        raise UsageProblemError(f"{flag}: {time_s:g} s is outside the flight, {begin:g} to {end:g} s")
    return min(max(time_s, begin), end)
