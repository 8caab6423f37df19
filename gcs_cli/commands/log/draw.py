"""``gcs log draw``: pictures and films of a flight from its log."""

from __future__ import annotations

import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from flightstack.flight_log.poses_file import write_poses
from flightstack.process.command_line import PictureOptions, expand_options, make_app
from flightstack.process.console import complain
from flightstack.process.supervised import supervised
from gcs_cli.errors import INTERRUPTED, CliError
from gcs_cli.report.analysis import read_flight
from gcs_cli.report.poses import find_run, poses_of

app = make_app(add_completion=False)

_NAME = "gcs log draw"
_END_TIMEOUT_S = 10.0


@app.command()
@expand_options
def draw(
    run: Annotated[Path, typer.Argument(help="Directory of a flight, or its log.", show_default=False)],
    options: PictureOptions,
    vehicle: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="Vehicle to draw.  [default: the log's]")
    ] = None,
) -> None:
    """Draw a flight: pictures, a film, or a window.

    Without --png, --sheet, --video or --view it makes a film, replay.mp4 next to the log. That takes minutes without
    a graphics card; --from, --to and --size shorten it.
    """
    found = find_run(run)
    flight = read_flight(found.log)
    poses = poses_of(flight, found, vehicle)
    if flight.damaged:
        complain(f"gcs: warning: the log is damaged; drawn up to {poses.time_s[-1]:.1f} s")
    if not (options.png or options.sheet or options.video or options.view):
        options = replace(options, video=found.film, overwrite=True)  # part of the run, like its report
    with tempfile.TemporaryDirectory(prefix="gcs-draw-") as folder:
        file = Path(folder) / "poses.npz"
        write_poses(file, poses)
        code = _render([str(file), *options.arguments(), f"--caller={_NAME}"])
    if code:
        raise typer.Exit(code)


def _render(arguments: list[str]) -> int:
    """Run ``sim-bridge render``, which reports its errors itself; return its exit code.

    It runs in a session of its own, so that Ctrl-C sends it a single signal, and ends with this process.
    """
    program = supervised("sim_bridge", "render", *arguments)
    with subprocess.Popen(program, stdin=subprocess.PIPE, start_new_session=True) as child:
        try:
            code = child.wait()
        except KeyboardInterrupt:
            child.terminate()
            if _ended(child) != INTERRUPTED:  # it ended before it could report
                raise
            raise CliError("", INTERRUPTED) from None
    if code < 0:
        raise CliError(f"the renderer was killed by signal {-code}")
    return code


def _ended(child: subprocess.Popen[bytes]) -> int:
    """Wait for the end, and kill the process after a timeout; return the exit code."""
    try:
        return child.wait(_END_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        child.kill()
        return child.wait()
