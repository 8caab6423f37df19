"""``gcs mission upload|download|clear|start``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcs_cli.settings import ConnectOption, TimeoutOption, meet_vehicle

if TYPE_CHECKING:
    from flightstack.plan import MissionItem

app = typer.Typer(help="The vehicle's mission.", no_args_is_help=True)


@app.command()
def upload(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="A .plan or .waypoints file.", show_default=False)],
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
) -> None:
    """Replace the vehicle's mission by that of a file."""
    from flightstack.plan import load_plan  # noqa: PLC0415
    from gcs_cli import calls  # noqa: PLC0415

    items = load_plan(file).items
    with meet_vehicle(context, connect, timeout) as connection:
        connection.complete(calls.upload(connection.session, items), f"upload of {file}")
    typer.echo(f"mission of {len(items)} items uploaded")


@app.command()
def download(
    context: typer.Context,
    file: Annotated[
        Path | None, typer.Argument(help="Where to write it; without, it is printed.", show_default=False)
    ] = None,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
) -> None:
    """Fetch the vehicle's mission."""
    from flightstack.geodesy import GeoPoint  # noqa: PLC0415
    from flightstack.plan import Plan, save_plan  # noqa: PLC0415
    from gcs_cli import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout) as connection:
        session = connection.session
        items = connection.complete(calls.download(session), "download").items
        if file is not None:
            # so that the file says where home is; a vehicle that does not tell leaves it open
            connection.wait_for(lambda: session.view.home is not None, 3.0)
        home = session.view.home
    if file is None:
        for seq, item in enumerate(items):
            typer.echo(item_line(seq, item))
    else:
        save_plan(file, Plan(items, None if home is None else GeoPoint(*home[:3])))
    typer.echo(f"mission of {len(items)} items downloaded" + (f" to {file}" if file else ""))


@app.command()
def clear(context: typer.Context, connect: ConnectOption = None, timeout: TimeoutOption = None) -> None:
    """Remove the vehicle's mission."""
    from gcs_cli import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout) as connection:
        connection.complete(calls.clear(connection.session), "clearing the mission")
    typer.echo("mission cleared")


@app.command()
def start(context: typer.Context, connect: ConnectOption = None, timeout: TimeoutOption = None) -> None:
    """Start the mission; the vehicle arms for it."""
    from gcs_cli import calls  # noqa: PLC0415
    from gcs_cli.commands.actions import order  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout) as connection:
        order(connection, calls.START_MISSION, "mission start")
    typer.echo("mission started")


def item_line(seq: int, item: MissionItem) -> str:
    """Show one item on one line."""
    from flightstack.plan import command_name  # noqa: PLC0415

    place = ""
    if item.position_deg is not None:
        latitude, longitude = item.position_deg
        place = f"{latitude:.7f} {longitude:.7f} {item.z:g} m"
    params = " ".join(f"{value:g}" for value in item.params)
    return f"{seq:4d}  {command_name(item.command):<22} {place:<34} [{params}]".rstrip()
