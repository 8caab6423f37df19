"""The command ``sim-bridge export-mjcf``: a vehicle's assembly as a model that any MuJoCo loads."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from sim_bridge.errors import UsageProblemError


def export_mjcf(
    vehicle: Annotated[
        str, typer.Option(help="Built-in vehicle (paper_quad, x_quad) or a TOML file.")
    ] = "paper_quad",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="Where to write it.  [default: stdout]")
    ] = None,
    scene: Annotated[bool, typer.Option("--scene", help="With sky, landmarks, light and cameras.")] = False,
) -> None:
    """Write a vehicle's multibody model as MJCF.

    A table of the masses goes to stderr.
    """
    from flightstack.params.vehicle import load_vehicle  # noqa: PLC0415
    from sim_bridge.multibody.assembly import TOLERANCE, assemble  # noqa: PLC0415
    from sim_bridge.multibody.mass_table import mass_table  # noqa: PLC0415
    from sim_bridge.multibody.mjcf import model_xml  # noqa: PLC0415

    loaded = load_vehicle(vehicle)
    text = model_xml(loaded, scene=scene)
    assembly = assemble(loaded)
    print(mass_table(loaded, assembly), file=sys.stderr)
    if assembly.worst_miss > TOLERANCE:
        print(f"sim-bridge: {assembly.worst_line()}: it flies as it is built", file=sys.stderr)
    if out is None:
        _print(text)
        return
    try:
        part = out.with_name(f".{out.name}.part")
        part.write_text(text, encoding="utf-8")
        part.replace(out)
    except OSError as error:
        raise UsageProblemError(f"--out {out}: cannot be written: {error.strerror}") from None


def _print(text: str) -> None:
    try:
        print(text, end="", flush=True)
    except OSError as error:
        sys.stdout = open(os.devnull, "w", encoding="ascii")  # noqa: SIM115  # Python tries again at its end
        if not isinstance(error, BrokenPipeError):  # who closed a pipe has read enough
            print(f"sim-bridge: cannot write the result: {error.strerror}", file=sys.stderr)
        raise typer.Exit(1) from None
