"""The command ``sim-bridge export-mjcf``: a vehicle's assembly as a model that any MuJoCo loads."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new, write_text_atomically
from flightstack.process import console
from flightstack.process.command_line import Overwrite
from sim_bridge.errors import UsageProblemError
from sim_bridge.output import complain, load_named_vehicle, print_result


def export_mjcf(
    vehicle: Annotated[
        str, typer.Option(help="Built-in vehicle (paper_quad, x_quad) or a TOML file.")
    ] = "paper_quad",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="Where to write it.  [default: stdout]")
    ] = None,
    overwrite: Overwrite = False,
    scene: Annotated[bool, typer.Option("--scene", help="With sky, landmarks, light and cameras.")] = False,
) -> None:
    """Write a vehicle's multibody model as MJCF.

    A table of the masses goes to stderr.
    """
    from sim_bridge.multibody.assembly import TOLERANCE, assemble  # noqa: PLC0415
    from sim_bridge.multibody.mass_table import mass_table  # noqa: PLC0415
    from sim_bridge.multibody.mjcf import model_xml  # noqa: PLC0415

    if out is not None:
        check_new(out, overwrite)
    loaded = load_named_vehicle(vehicle)
    text = model_xml(loaded, scene=scene)
    assembly = assemble(loaded)
    console.complain(mass_table(loaded, assembly))
    if assembly.worst_miss > TOLERANCE:
        complain(f"{assembly.worst_line()}: it flies as it is built")
    if out is None:
        print_result(text.removesuffix("\n"))
        return
    try:
        write_text_atomically(out, text)
    except OSError as error:
        raise UsageProblemError(f"--out {out}: cannot be written: {error.strerror}") from None
