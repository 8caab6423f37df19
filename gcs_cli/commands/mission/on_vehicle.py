"""``gcs mission upload|download|verify|clear|start|pause|resume|jump``."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from flightstack.plan import MissionType
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.actions import in_flight, in_mission
from gcs_cli.commands.actions import ActionOptions, run_action
from gcs_cli.commands.confirmation import YesOption
from gcs_cli.commands.mission.plan_parts import add_download, add_upload, add_verify, clear_part
from gcs_cli.settings import LinkOptions
from gcs_cli.transfers.vehicle_plans import KINDS

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


add_upload(
    app,
    None,
    """Replace the vehicle's mission by that of a file.

    Geofence and rally points are replaced if the file has any, else the vehicle keeps its own. They are uploaded
    first, because the vehicle checks the mission against them. If a part is refused, or after Ctrl-C, the former
    plans are restored; a second Ctrl-C ends at once.""",
)
add_download(app, KINDS, "Download the vehicle's mission, geofence and rally points.")
add_verify(
    app,
    None,
    """Compare the vehicle's plan with a file; exit 1 if they differ.

    Compares the mission, and geofence and rally points if the file has any.""",
)


@app.command()
@expand_options
def clear(
    context: typer.Context,
    link: LinkOptions,
    part: Annotated[Part, typer.Option("--type", help="Part of the plan to remove.")] = Part.MISSION,
    yes: YesOption = False,
) -> None:
    """Remove the vehicle's mission, geofence or rally points.

    If the vehicle is armed, asks first on a terminal; elsewhere it needs --yes.
    """
    clear_part(context, link, MissionType[part.name], _PART_NAMES[part], part.value, yes)


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
    """Make an item the current one; a mission in flight goes there."""
    run_action(context, link, options, in_mission.jump(seq))
