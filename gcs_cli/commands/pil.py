"""``gcs pil``: the loops on a target, compared with those in Python and in C."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from flightstack.process.command_line import (
    IN_LOOPS,
    IN_OUTPUT,
    VEHICLE,
    PanelCommand,
    expand_options,
    make_app,
)
from flightstack.process.options import Controller, Gains, InnerHz, OuterHz
from gcs_cli.fly.fly_flags import RunOptions, complete_options
from gcs_cli.pil.pil_flags import PilOptions, VerdictOptions
from gcs_cli.settings import JsonOption, OverwriteOption

app = make_app(add_completion=False)


@app.command(cls=PanelCommand)
@partial(expand_options, without=("loops", "speed"))
def fly(
    context: typer.Context,
    options: PilOptions,
    run: RunOptions,
    verdict: VerdictOptions,
    target: Annotated[
        str, typer.Option(metavar="TARGET", help="emulated, host, or serial:DEVICE[:BAUD].", **IN_LOOPS)
    ] = "emulated",
) -> None:
    """Fly a mission with each of the loops, and compare.

    The loops fly in Python (MIL), in C (SIL) and on a target (PIL).
    """
    from gcs_cli.pil.pil_commands import run_flights

    run_flights(complete_options(context, "pil", options, run), verdict, target)


@app.command("free-run", cls=PanelCommand)
@partial(expand_options, without=("loops", "speed"))
def free_run(
    context: typer.Context,
    options: PilOptions,
    run: RunOptions,
    target: Annotated[
        str, typer.Option(metavar="TARGET", help="host, or serial:DEVICE[:BAUD].", **IN_LOOPS)
    ] = "host",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="DIR", help="Directory.  [default: runs/<stamp>-<name>-pil]", **IN_OUTPUT
        ),
    ] = None,
) -> None:
    """Fly a mission with the loops run by the target's own timer.

    The flight is in real time. Jitter, overruns and the age of states are measured.
    """
    from gcs_cli.pil.free_run import run_free

    run_free(complete_options(context, "pil", options, run), run, target, out)


@app.command()
@expand_options
def replay(
    log: Annotated[
        Path,
        typer.Argument(help="A flight log (ULog), or test vectors (.csv, .mat, .h5).", show_default=False),
    ],
    verdict: VerdictOptions,
    target: Annotated[
        str, typer.Option(metavar="TARGET", help="emulated, host, c, or serial:DEVICE[:BAUD].")
    ] = "emulated",
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="The vehicle's TOML file.  [default: the log's vehicle, by its name]"
        ),
    ] = None,
) -> None:
    """Feed a target with the inputs of a flight log.

    The outputs of the target are compared with those in the log.
    """
    from gcs_cli.pil.pil_commands import run_replay

    run_replay(log, verdict, target, vehicle)


@app.command()
def vectors(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="The file to write: .csv, .mat or .h5.", show_default=False)
    ],
    log: Annotated[
        Path | None,
        typer.Option(metavar="LOG", help="Take inputs and outputs from this flight log.", show_default=False),
    ] = None,
    vehicle: Annotated[str, VEHICLE] = "paper_quad",
    controller: Controller = "pid",
    gains: Gains = "tuned",
    inner_hz: InnerHz = 500.0,
    outer_hz: OuterHz = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write test vectors for a replay, as CSV or MATLAB.

    Without a log, they are an excitation that reaches every term and limit of the loops.
    """
    from gcs_cli.pil.pil_commands import run_vectors

    run_vectors(file, log, (vehicle, controller, gains, inner_hz, outer_hz), overwrite, as_json)


@app.command()
def generate(
    controller: Annotated[
        str, typer.Option("--controller", metavar="NAME", help="An installed attitude controller.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="DIR", help="Directory.  [default: build/firmware-<name>]"),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Write the firmware with your own controller as C."""
    from gcs_cli.pil.pil_commands import run_generate

    run_generate(controller, out, as_json)


@app.command()
def build(
    board: Annotated[str, typer.Argument(help="Board: nucleo-f401re, nucleo-f446re, pico2 or pico2-riscv.")],
    controller: Annotated[
        str,
        typer.Option(
            "--controller", metavar="NAME", help="Attitude controller that the firmware flies with."
        ),
    ] = "pid",
    baud: Annotated[
        int, typer.Option(min=1_200, max=2_500_000, metavar="BAUD", help="Rate of the serial port.")
    ] = 115_200,
    compiler: Annotated[str, typer.Option(metavar="NAME", help="zig, or gcc for arm-none-eabi-gcc.")] = "zig",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="DIR", help="Directory.  [default: build/<board>]")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Build the firmware for a board: the file for its drive."""
    from gcs_cli.pil.board_build import run_build

    run_build(board, controller, baud, compiler, out, as_json)


@app.command()
def doctor(
    port: Annotated[
        str | None,
        typer.Option(metavar="DEVICE", help="Serial port, for example /dev/ttyUSB1.", show_default=False),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(metavar="TARGET", help="Instead of --port: host or emulated.", show_default=False),
    ] = None,
    baud: Annotated[
        list[int] | None,
        typer.Option(
            min=1_200,
            metavar="BAUD",
            help="Rate to try; may be repeated.  [default: 115200 230400 460800 921600]",
        ),
    ] = None,
    exchanges: Annotated[
        int, typer.Option(min=1, max=100_000, metavar="N", help="Steps to measure at each rate.")
    ] = 300,
    conformance: Annotated[
        bool,
        typer.Option("--conformance", help="Check that a port keeps the contract of the firmware instead."),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Measure the link to a target, and suggest settings."""
    from gcs_cli.pil.conformance.command import run_conformance
    from gcs_cli.pil.pil_commands import run_doctor

    if conformance:
        run_conformance(port, target, baud, as_json)
        return
    run_doctor(port, target, baud, exchanges, as_json)
