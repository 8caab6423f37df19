"""``gcs mission upload|download|check|clear|start``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flightstack.process.command_line import make_app
from gcs_cli.settings import ConnectOption, InstanceOption, OverwriteOption, TimeoutOption, meet_vehicle
from gcs_cli.transfers.plan_files import PlanArgument

if TYPE_CHECKING:
    from flightstack.plan import MissionItem
    from gcs_cli.link.connection import Connection
    from gcs_cli.transfers.plan_parts import Uploads

app = make_app(help="The vehicle's mission.", no_args_is_help=True)


class Part(StrEnum):
    """What ``--type`` may be."""

    MISSION = "mission"
    FENCE = "fence"
    RALLY = "rally"
    ALL = "all"


@app.command()
def upload(
    context: typer.Context,
    file: PlanArgument,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Replace the vehicle's mission by that of a file.

    Geofence and rally points are replaced if the file has any, else the vehicle keeps its own. They go first, because
    the vehicle checks the mission against them. If a part is refused, or after Ctrl-C, the vehicle gets back the plans
    that it held before; a second Ctrl-C ends at once.
    """
    from flightstack.plan import load_plan  # noqa: PLC0415
    from gcs_cli.fly.interruption import Interruption  # noqa: PLC0415
    from gcs_cli.transfers.plan_parts import Uploads, parts_to_send  # noqa: PLC0415

    plan = load_plan(file)
    with meet_vehicle(context, connect, timeout, instance) as connection, Interruption() as interruption:
        uploads = Uploads(connection.session, plan, restores=True, interrupted=lambda: interruption.reason)
        _complete(connection, uploads, file)
    for part in parts_to_send(plan):
        typer.echo(f"{part.name} of {len(part.items)} items uploaded")
    for part in uploads.kept:
        typer.echo(f"the vehicle keeps its {part.name} of {len(part.items)} items")


def _complete(connection: Connection, uploads: Uploads, file: Path) -> None:
    """Run an upload to its end; raise CliError, with what the vehicle holds if the upload ends early."""
    from gcs_cli.errors import CliError, VehicleLostError  # noqa: PLC0415

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
def check(file: PlanArgument) -> None:
    """Check a file as the vehicle does, without one.

    Mission, geofence and rally points.
    """
    from flightstack.core.geodesy import GeoPoint  # noqa: PLC0415
    from flightstack.plan import load_plan  # noqa: PLC0415
    from gcs_cli.errors import FAILED, CliError  # noqa: PLC0415
    from gcs_cli.transfers.plan_parts import plan_parts, plan_problem  # noqa: PLC0415

    plan = load_plan(file)
    first = next((item.position_deg for item in plan.items if item.position_deg is not None), (0.0, 0.0))
    problem = plan_problem(plan, plan.home or GeoPoint(*first, 0.0))
    if problem is not None:
        raise CliError(f"{file}: {problem}", FAILED)
    for part in plan_parts(plan):
        typer.echo(f"{part.name} of {len(part.items)} items: good")


@app.command()
def download(
    context: typer.Context,
    file: Annotated[
        Path | None, typer.Argument(help="Where to write it; without, it is printed.", show_default=False)
    ] = None,
    overwrite: OverwriteOption = False,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Fetch the vehicle's mission, geofence and rally points."""
    from flightstack.core.atomic_file import check_new  # noqa: PLC0415
    from flightstack.core.geodesy import GeoPoint  # noqa: PLC0415
    from flightstack.plan import MissionType, Plan, save_plan  # noqa: PLC0415
    from gcs_cli.link import calls  # noqa: PLC0415
    from gcs_cli.transfers.plan_parts import plan_parts  # noqa: PLC0415

    if file is not None:
        check_new(file, overwrite)
    with meet_vehicle(context, connect, timeout, instance) as connection:
        session = connection.session
        items, fence, rally = (
            connection.complete(
                calls.download(session, kind), "download", may_lack=kind != MissionType.MISSION
            ).items
            for kind in (MissionType.MISSION, MissionType.FENCE, MissionType.RALLY)
        )
        if file is not None:
            # so that the file says where home is; a vehicle that does not tell leaves it open
            connection.wait_for(lambda: session.view.home is not None, 3.0)
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
def clear(
    context: typer.Context,
    part: Annotated[Part, typer.Option("--type", help="What to remove.")] = Part.MISSION,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Remove the vehicle's mission, geofence or rally points."""
    from flightstack.plan import MissionType  # noqa: PLC0415
    from gcs_cli.link import calls  # noqa: PLC0415

    kind = MissionType[part.name]
    name = {
        Part.FENCE: "geofence",
        Part.RALLY: "rally points",
        Part.ALL: "mission, geofence and rally points",
    }
    said = name.get(part, "mission")
    with meet_vehicle(context, connect, timeout, instance) as connection:
        connection.complete(calls.clear(connection.session, kind), f"clearing the {said}")
    typer.echo(f"{said} cleared")


@app.command()
def start(
    context: typer.Context,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Start the mission; the vehicle arms for it."""
    from gcs_cli.commands.actions import order  # noqa: PLC0415
    from gcs_cli.link import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
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
