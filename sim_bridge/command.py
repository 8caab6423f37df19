"""The command line of ``sim-bridge``: the simulator process, ``open-loop``, ``export-mjcf`` and ``render``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.errors import ConfigError, WriteError
from flightstack.process import collection, console
from flightstack.process.command_line import (
    Overwrite,
    PanelCommand,
    PanelGroup,
    PictureOptions,
    UsageError,
    Version,
    expand_options,
    make_app,
    run_app,
    usage_sentence,
)
from flightstack.process.plain_arguments import read_plain
from sim_bridge import options
from sim_bridge.errors import PlantDivergedError, UsageProblemError
from sim_bridge.output import complain
from sim_bridge.server.connection import hold, listen

app = make_app(name="sim-bridge", cls=PanelGroup)


@app.callback(invoke_without_command=True)
@expand_options
def run(
    context: typer.Context,
    given: options.SimulatorOptions,
    version: Version = False,  # handled by its callback
) -> None:
    """Simulate a vehicle for one flight stack, which connects over TCP.

    Ctrl-C ends the simulation.
    """
    if context.invoked_subcommand is not None:
        return
    raise typer.Exit(_simulate(given))


def _simulate(given: options.SimulatorOptions) -> int:
    from sim_bridge.program import simulate

    return simulate(given)


def _run(words: Sequence[str]) -> int:
    given = read_plain(options.SimulatorOptions, words)
    return run_app(app, "sim-bridge", words) if given is None else console.checked_code(_simulate(given))


def check_arguments(given: Sequence[str]) -> None:
    """Check a command line of the simulator; raise UsageError, UsageProblemError, ConfigError, KeyboardInterrupt."""
    _run([*given, "--check"])


def check_port(host: str, port: int) -> None:
    """Raise OSError if the simulator cannot listen on the port."""
    with listen(host, port) as listener, hold(listener):
        pass


@app.command("open-loop", cls=PanelCommand)
@expand_options
def open_loop(given: options.OpenLoopOptions) -> None:
    """Print the state after a flight at constant rotor speeds.

    Rotor speeds are not limited.
    """
    from sim_bridge.program import fly_open_loop

    fly_open_loop(given)


@app.command()
@expand_options
def render(
    poses: Annotated[Path, typer.Argument(help="File of poses (.npz), as gcs log draw writes it.")],
    given: PictureOptions,
    vehicle: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="Vehicle to draw.  [default: the file's]")
    ] = None,
    caller: Annotated[
        str, typer.Option(hidden=True, help="Command named in error messages.")
    ] = "sim-bridge render",
) -> None:
    """Draw pictures or a film of a flight."""
    from sim_bridge.render.render_command import draw

    draw(poses, given, vehicle, caller)


@app.command()
def export_mjcf(
    vehicle: options.Vehicle = "paper_quad",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="File to write.  [default: stdout]")
    ] = None,
    overwrite: Overwrite = False,
    scene: Annotated[bool, typer.Option("--scene", help="Add sky, landmarks, light and cameras.")] = False,
) -> None:
    """Write a vehicle's multibody model as MJCF, for any MuJoCo.

    A table of the masses goes to stderr.
    """
    from sim_bridge.program import write_mjcf

    write_mjcf(vehicle, out, overwrite, scene)


def run_command(argv: list[str]) -> int:
    """Run a command line; return the exit code. Raises KeyboardInterrupt."""
    console.replace_unencodable()
    try:
        with collection.paused():
            return _run(argv)
    except PlantDivergedError as error:
        complain(error)
        return 1
    except UsageError as error:
        complain(usage_sentence(error))
    except (UsageProblemError, ConfigError) as error:
        complain(error)
        return 1 if isinstance(error, WriteError) else 2
    except OSError as error:
        return console.report_os_error("sim-bridge", error)
    return 2
