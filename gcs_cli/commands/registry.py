"""The commands of ``gcs`` and their groups. The module of a command is imported when the command is used."""

from __future__ import annotations

from typing import Any

import typer

from flightstack.process.command_line import HELP_FLAGS, make_app
from gcs_cli.commands.lazy_group import LazyCommand, LazyGroup
from gcs_cli.output import can_draw

_SIMULATION = "gcs_cli.commands.simulation"
_SCENARIOS = "gcs_cli.commands.scenarios"
_ACTIONS = "gcs_cli.commands.actions"
_MISSION = "gcs_cli.commands.mission.on_vehicle"
_PLANS = "gcs_cli.commands.mission.files"
_PARAM = "gcs_cli.commands.param"
_LOG = "gcs_cli.commands.log.on_vehicle"
_LOG_FILE = "gcs_cli.commands.log.file"
_PIL = "gcs_cli.commands.pil"
_PIL_FLY = "fly"


class GcsGroup(LazyGroup):
    """``gcs``."""

    lazy = {  # noqa: RUF012  # ClassVar in the base
        "fly": LazyCommand(_SIMULATION, "Fly a mission in simulation and write log, summary and report."),
        "sim": LazyCommand(_SIMULATION, "Simulate one or several vehicles for any MAVLink client."),
        "paper": LazyCommand(
            "gcs_cli.commands.paper", "Fly every experiment of the paper and report the results."
        ),
        "test": LazyCommand(_SCENARIOS, "Fly scenario files and check the flights."),
        "campaign": LazyCommand(_SCENARIOS, "Fly a scenario many times with varied inputs."),
        "arm": LazyCommand(_ACTIONS, "Arm the vehicle."),
        "disarm": LazyCommand(_ACTIONS, "Disarm the vehicle."),
        "takeoff": LazyCommand(_ACTIONS, "Take off; arm first if disarmed."),
        "land": LazyCommand(_ACTIONS, "Land at the current position."),
        "rtl": LazyCommand(_ACTIONS, "Return to launch and land."),
        "hold": LazyCommand(_ACTIONS, "Stop and hold the position."),
        "goto": LazyCommand(_ACTIONS, "Fly to a position and hold there."),
        "yaw": LazyCommand(_ACTIONS, "Turn to a heading and hold the position."),
        "speed": LazyCommand(_ACTIONS, "Set the ground speed until disarmed."),
        "mode": LazyCommand(_ACTIONS, "Select a flight mode, or list the modes of the vehicle."),
        "set-home": LazyCommand(_ACTIONS, "Set the home position."),
        "sethome": LazyCommand(_ACTIONS, "Set the home position.", hidden=True),
        "terminate": LazyCommand(_ACTIONS, "End the flight at once: the rotors stop and the vehicle falls."),
        "inject": LazyCommand(_ACTIONS, "Inject a failure (MAV_CMD_INJECT_FAILURE)."),
        "reboot": LazyCommand(_ACTIONS, "Reboot the vehicle, which must be on the ground."),
        "wait": LazyCommand("gcs_cli.commands.wait", "Wait until the vehicle is in a state."),
        "status": LazyCommand("gcs_cli.commands.status", "Show the state of the vehicle."),
        "watch": LazyCommand("gcs_cli.commands.watch", "Watch and command the vehicle; q or Ctrl-C ends."),
        "messages": LazyCommand(
            "gcs_cli.commands.messages", "Print the status texts of the vehicle until Ctrl-C."
        ),
        "listen": LazyCommand(
            "gcs_cli.commands.listen", "Print messages of the vehicle, one a line, until Ctrl-C."
        ),
        "send": LazyCommand("gcs_cli.commands.send", "Send a MAVLink message to the vehicle."),
        "record": LazyCommand("gcs_cli.commands.record", "Record all messages of the link until Ctrl-C."),
        "shell": LazyCommand("gcs_cli.commands.shell", "Run commands over one link."),
        "perf": LazyCommand("gcs_cli.commands.perf", "Show the timing of the flight stack's loops."),
        "replay": LazyCommand(
            "gcs_cli.commands.replay", "Replay a log as a vehicle that any client can watch."
        ),
        "report": LazyCommand("gcs_cli.commands.report", "Write the report page of a flight from its log."),
        "compare": LazyCommand("gcs_cli.commands.compare", "Compare two or more flights."),
        "estimate": LazyCommand(
            "gcs_cli.commands.estimate",
            "Estimate attitude, velocity, position from a log.",
        ),
    }

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert ``watch`` if nothing is given in a terminal."""
        return super().parse_args(ctx, args or (["watch"] if can_draw() else []))


class MissionGroup(LazyGroup):
    """``gcs mission``."""

    lazy = {  # noqa: RUF012
        "new": LazyCommand("gcs_cli.commands.mission.new", "Write a mission of a pattern."),
        "check": LazyCommand(
            _PLANS,
            "Check a file as the vehicle does.",
        ),
        "show": LazyCommand(_PLANS, "Show a plan: a table of its items, and a drawing."),
        "convert": LazyCommand(_PLANS, "Convert a plan, and name what the new format cannot hold."),
        "upload": LazyCommand(_MISSION, "Replace the vehicle's mission by that of a file."),
        "download": LazyCommand(_MISSION, "Download the vehicle's mission, geofence and rally points."),
        "verify": LazyCommand(_MISSION, "Compare the vehicle's plan with a file; exit 1 if they differ."),
        "clear": LazyCommand(_MISSION, "Remove the vehicle's mission, geofence or rally points."),
        "start": LazyCommand(_MISSION, "Start the mission; the vehicle arms for it."),
        "pause": LazyCommand(_MISSION, "Pause the mission: the vehicle holds its position."),
        "resume": LazyCommand(_MISSION, "Resume a paused mission at its current item."),
        "jump": LazyCommand(_MISSION, "Make an item the current one; a mission in flight goes there."),
    }


def _part_commands(app: str, name: str) -> dict[str, LazyCommand]:
    summaries = {
        "upload": f"Replace the vehicle's {name} by that of a file; its mission stays.",
        "download": f"Download the vehicle's {name}.",
        "show": f"Show the {name} of a file or of the vehicle.",
        "verify": f"Compare the vehicle's {name} with that of a file; exit with 1 if they differ.",
        "clear": f"Remove the vehicle's {name}.",
    }
    return {
        command: LazyCommand("gcs_cli.commands.mission.plan_parts", summary, app=app)
        for command, summary in summaries.items()
    }


class FenceGroup(LazyGroup):
    """``gcs fence``."""

    lazy = _part_commands("fence_app", "geofence")


class RallyGroup(LazyGroup):
    """``gcs rally``."""

    lazy = _part_commands("rally_app", "list of rally points")


class ParamGroup(LazyGroup):
    """``gcs param``."""

    lazy = {  # noqa: RUF012
        "list": LazyCommand(_PARAM, "List the parameters; highlight those not at their default."),
        "search": LazyCommand(
            _PARAM,
            "Search names and descriptions; misspelt words match too.",
        ),
        "get": LazyCommand(_PARAM, "Show parameters with their metadata."),
        "set": LazyCommand(_PARAM, "Set a parameter."),
        "reset": LazyCommand(_PARAM, "Reset parameters to their defaults."),
        "save": LazyCommand(_PARAM, "Write all parameters to a file, as QGroundControl does."),
        "load": LazyCommand(_PARAM, "Set the parameters that a file has; the others stay as they are."),
        "diff": LazyCommand(_PARAM, "Show parameters that differ from the defaults, or from a file."),
    }


class LogGroup(LazyGroup):
    """``gcs log``."""

    lazy = {  # noqa: RUF012
        "list": LazyCommand(_LOG, "List the logs, the oldest first."),
        "download": LazyCommand(_LOG, "Download a log, or all of them."),
        "erase": LazyCommand(_LOG, "Erase all logs but the one that is being written."),
        "info": LazyCommand(_LOG_FILE, "Show what a log holds."),
        "plot": LazyCommand("gcs_cli.commands.log.plot", "Plot fields of a log."),
        "export": LazyCommand(_LOG_FILE, "Export a log as CSV, Parquet, MCAP or Rerun."),
        "draw": LazyCommand("gcs_cli.commands.log.draw", "Draw a flight: pictures, a film, or a window."),
    }


class PilGroup(LazyGroup):
    """``gcs pil``; ``gcs pil square.plan`` is ``gcs pil fly square.plan``."""

    lazy = {  # noqa: RUF012
        _PIL_FLY: LazyCommand(_PIL, "Fly a mission with each of the loops, and compare."),
        "free-run": LazyCommand(_PIL, "Fly a mission with the loops run by the target's own timer."),
        "replay": LazyCommand(_PIL, "Feed a target with the inputs of a flight log."),
        "vectors": LazyCommand(_PIL, "Write test vectors for a replay, as CSV or MATLAB."),
        "generate": LazyCommand(_PIL, "Write the firmware with your own controller as C."),
        "build": LazyCommand(_PIL, "Build the firmware for a board: the file for its drive."),
        "doctor": LazyCommand(_PIL, "Measure the link to a target, and suggest settings."),
    }

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert ``fly`` if the first argument is no command."""
        if args and args[0] not in self.commands and args[0] not in HELP_FLAGS:
            args = [_PIL_FLY, *args]
        return super().parse_args(ctx, args)


def add_groups(app: typer.Typer) -> None:
    """Add the groups of commands to ``gcs``."""
    for name, group, text in (
        ("mission", MissionGroup, "Missions: files, and the vehicle's."),
        ("fence", FenceGroup, "The vehicle's geofence."),
        ("rally", RallyGroup, "The vehicle's rally points."),
        ("param", ParamGroup, "The vehicle's parameters."),
        ("log", LogGroup, "Flight logs: those on the vehicle, and files."),
        (
            "pil",
            PilGroup,
            "Check the loops in C and on a target.\n\n`gcs pil MISSION` flies it as MIL, SIL and PIL.",
        ),
    ):
        app.add_typer(make_app(cls=group, help=text, no_args_is_help=True), name=name)
