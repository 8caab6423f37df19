"""``gcs replay``: pictures and films of a flight from its log."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from gcs_cli.errors import FAILED, CliError

_PATIENCE_S = 10.0


def replay(
    run: Annotated[Path, typer.Argument(help="Directory of a flight, or its log.", show_default=False)],
    png: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a picture.")] = None,
    sheet: Annotated[Path | None, typer.Option(metavar="FILE", help="Write several in one picture.")] = None,
    video: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write a film, .mp4 or .gif.  [default: replay.mp4 beside the log]"
        ),
    ] = None,
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
    vehicle: Annotated[str | None, typer.Option(help="Vehicle to draw.  [default: the log's]")] = None,
    no_words: Annotated[bool, typer.Option("--no-words", help="Leave out the figures.")] = False,
) -> None:
    """Show a flight: pictures, a film, or a window that plays it."""
    from flightstack.poses_file import write_poses  # noqa: PLC0415
    from gcs_cli.analysis import read_flight  # noqa: PLC0415
    from gcs_cli.replay import find_run, poses_of  # noqa: PLC0415

    found = find_run(run)
    poses = poses_of(read_flight(found.log), found, vehicle)
    if not (png or sheet or video or view):
        video = found.film
    given = {
        "--png": png, "--sheet": sheet, "--video": video, "--at": at, "--camera": camera, "--size": size,
        "--fps": fps, "--from": begin, "--to": end, "--speed": speed,
    }  # fmt: skip
    options = [f"{flag}={value}" for flag, value in given.items() if value is not None]
    flags = [*(["--view"] if view else []), *(["--no-words"] if no_words else [])]
    with tempfile.TemporaryDirectory(prefix="gcs-replay-") as folder:
        file = Path(folder) / "poses.npz"
        write_poses(file, poses)
        code = _render([str(file), *options, *flags])
    if code:
        raise typer.Exit(code)


def _render(arguments: list[str]) -> int:
    """Run ``sim-bridge render``, which says itself what it has to say; return its exit code.

    It has a session of its own: Ctrl-C is ours, and one signal lets it end in order.
    """
    program = [sys.executable, "-m", "sim_bridge", "render", *arguments]
    with subprocess.Popen(program, start_new_session=True) as child:
        try:
            code = child.wait()
        except KeyboardInterrupt:
            child.terminate()
            if _ended(child) != FAILED:  # it had not got far enough to say so
                raise
            return FAILED
    if code < 0:
        raise CliError(f"sim-bridge render was killed by signal {-code}")
    return code


def _ended(child: subprocess.Popen[bytes]) -> int:
    """Wait for the end that was asked for, not for ever; return the exit code."""
    try:
        return child.wait(_PATIENCE_S)
    except subprocess.TimeoutExpired:
        child.kill()
        return child.wait()
