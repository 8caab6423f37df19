"""``gcs mission upload|download|verify|clear|start|pause|resume|jump``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new
from flightstack.plan import MissionType
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.actions import in_flight, in_mission
from gcs_cli.commands.actions import ActionOptions, run_action
from gcs_cli.fly.processes import Interruption
from gcs_cli.link import calls
from gcs_cli.plans.formats.files import check_suffix, load_any
from gcs_cli.settings import LinkOptions, OverwriteOption, output_of
from gcs_cli.transfers.plan_files import AnyPlanArgument
from gcs_cli.transfers.plan_parts import Uploads, parts_to_send
from gcs_cli.transfers.plan_transfers import (
    complete_upload,
    say_downloaded,
    say_uploaded,
    say_verified,
)
from gcs_cli.transfers.vehicle_plans import KINDS, download_plan
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)


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
def upload(context: typer.Context, link: LinkOptions, file: AnyPlanArgument) -> None:
    """Replace the vehicle's mission by that of a file.

    Geofence and rally points are replaced if the file has any, else the vehicle keeps its own. They are uploaded
    first, because the vehicle checks the mission against them. If a part is refused, or after Ctrl-C, the former
    plans are restored; a second Ctrl-C ends at once.
    """
    plan = load_any(file)
    with connect_vehicle(context, link) as connection, Interruption() as interruption:
        uploads = Uploads(connection.session, plan, restores=True, interrupted=lambda: interruption.reason)
        complete_upload(connection, uploads, file)
    say_uploaded(output_of(context, link), parts_to_send(plan), uploads)


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
        check_suffix(file)
        check_new(file, overwrite)
    with connect_vehicle(context, link) as connection:
        plan = download_plan(connection, with_home=file is not None)
    say_downloaded(output_of(context, link), plan, file, KINDS)


@app.command()
@expand_options
def verify(context: typer.Context, link: LinkOptions, file: AnyPlanArgument) -> None:
    """Compare the vehicle's plan with a file, item by item; exit with 1 if they differ.

    Compares the mission, and geofence and rally points if the file has any.
    """
    plan = load_any(file)
    parts = parts_to_send(plan)
    with connect_vehicle(context, link) as connection:
        stored = download_plan(connection, with_home=False, kinds=tuple(part.kind for part in parts))
        tolerance = calls.storage_tolerance(connection.session)
    say_verified(output_of(context, link), parts, stored, tolerance, file)


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
    output_of(context, link).say("cleared", f"{name} cleared", part=part.value)


@app.command()
@expand_options
def start(context: typer.Context, link: LinkOptions, options: ActionOptions) -> None:
    """Start the mission; the vehicle arms for it.

    Ends when the vehicle is armed and flies the mission.
    """
    run_action(context, link, options, in_flight.start_mission())


@app.command()
@expand_options
def pause(context: typer.Context, link: LinkOptions, options: ActionOptions) -> None:
    """Pause the mission: the vehicle holds its position."""
    run_action(context, link, options, in_mission.pause())


@app.command()
@expand_options
def resume(context: typer.Context, link: LinkOptions, options: ActionOptions) -> None:
    """Resume a paused mission at its current item."""
    run_action(context, link, options, in_mission.resume())


@app.command()
@expand_options
def jump(
    context: typer.Context,
    link: LinkOptions,
    options: ActionOptions,
    seq: Annotated[int, typer.Argument(metavar="N", min=0, max=65_535, help="Number of the item, from 0.")],
) -> None:
    """Make an item of the mission the current one; a mission in flight continues there."""
    run_action(context, link, options, in_mission.jump(seq))
