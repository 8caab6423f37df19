"""``gcs mission upload|download|check|clear|start``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new
from flightstack.core.geodesy import GeoPoint
from flightstack.plan import MissionItem, MissionType, Plan, command_name, load_plan, save_plan
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.errors import CliError, VehicleLostError
from gcs_cli.fly.processes import Interruption
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.settings import LinkOptions, OverwriteOption
from gcs_cli.transfers.plan_files import PlanArgument
from gcs_cli.transfers.plan_parts import Uploads, parts_to_send, plan_parts
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

_HOME_WAIT_S = 3.0


class Part(StrEnum):
    """Values of ``--type``."""

    MISSION = "mission"
    FENCE = "fence"
    RALLY = "rally"
    ALL = "all"


_PART_NAMES = {
    Part.MISSION: "mission",
    Part.FENCE: "geofence",
    Part.RALLY: "rally points",
    Part.ALL: "mission, geofence and rally points",
}


@app.command()
@expand_options
def upload(context: typer.Context, link: LinkOptions, file: PlanArgument) -> None:
    """Replace the vehicle's mission by that of a file.

    Geofence and rally points are replaced if the file has any, else the vehicle keeps its own. They are uploaded
    first, because the vehicle checks the mission against them. If a part is refused, or after Ctrl-C, the former
    plans are restored; a second Ctrl-C ends at once.
    """
    plan = load_plan(file)
    with connect_vehicle(context, link) as connection, Interruption() as interruption:
        uploads = Uploads(connection.session, plan, restores=True, interrupted=lambda: interruption.reason)
        _complete(connection, uploads, file)
    for part in parts_to_send(plan):
        typer.echo(f"{part.name} of {len(part.items)} items uploaded")
    for part in uploads.kept:
        typer.echo(f"the vehicle keeps its {part.name} of {len(part.items)} items")


def _complete(connection: Connection, uploads: Uploads, file: Path) -> None:
    """Run an upload to its end; if it ends early, raise CliError with the plans that the vehicle holds."""

    def name() -> str:
        return f"upload of the {uploads.name} of {file}"

    try:
        connection.complete(uploads, name)
    except VehicleLostError as error:
        raise CliError(f"{error}; {uploads.state}") from None
    except KeyboardInterrupt:
        raise CliError(f"{name()}: interrupted; {uploads.state}") from None
    except OSError as error:
        raise CliError(f"{name()}: {error.strerror or error}; {uploads.state}") from None


@app.command()
@expand_options
def download(
    context: typer.Context,
    link: LinkOptions,
    file: Annotated[
        Path | None,
        typer.Argument(help="File to write; without it, the plan is printed.", show_default=False),
    ] = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Download the vehicle's mission, geofence and rally points."""
    if file is not None:
        check_new(file, overwrite)
    with connect_vehicle(context, link) as connection:
        session = connection.session
        items, fence, rally = (
            connection.complete(
                calls.download(session, kind), "download", may_lack=kind != MissionType.MISSION
            ).items
            for kind in (MissionType.MISSION, MissionType.FENCE, MissionType.RALLY)
        )
        if file is not None:  # the file holds home too, if the vehicle sends it
            connection.wait_for(lambda: session.view.home is not None, _HOME_WAIT_S)
        home = session.view.home
    plan = Plan(items, None if home is None else GeoPoint(*home[:3]), fence=fence, rally=rally)
    if file is not None:
        save_plan(file, plan)
    for part in plan_parts(plan):
        if file is None:
            for seq, item in enumerate(part.items):
                typer.echo(item_line(seq, item))
        if part.items or part.kind == MissionType.MISSION:
            typer.echo(f"{part.name} of {len(part.items)} items downloaded" + (f" to {file}" if file else ""))


@app.command()
@expand_options
def clear(
    context: typer.Context,
    link: LinkOptions,
    part: Annotated[Part, typer.Option("--type", help="What to remove.")] = Part.MISSION,
) -> None:
    """Remove the vehicle's mission, geofence or rally points."""
    name = _PART_NAMES[part]
    with connect_vehicle(context, link) as connection:
        connection.complete(calls.clear(connection.session, MissionType[part.name]), f"clearing the {name}")
    typer.echo(f"{name} cleared")


@app.command()
@expand_options
def start(context: typer.Context, link: LinkOptions) -> None:
    """Start the mission; the vehicle arms for it."""
    with connect_vehicle(context, link) as connection:
        connection.command(calls.START_MISSION, "mission start")
    typer.echo("mission started")


def item_line(seq: int, item: MissionItem) -> str:
    """Format one item on one line."""
    position = ""
    if item.position_deg is not None:
        latitude, longitude = item.position_deg
        position = f"{latitude:.7f} {longitude:.7f} {item.z:g} m"
    params = " ".join(f"{value:g}" for value in item.params)
    return f"{seq:4d}  {command_name(item.command):<22} {position:<34} [{params}]".rstrip()
