"""``gcs arm``, ``takeoff``, ``goto``, ``mode`` and similar: one action, done when the vehicle reports the effect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from flightstack.core.errors import plain
from flightstack.process.command_line import IN_OUTPUT, expand_options, make_app
from gcs_cli.actions import in_flight, on_vehicle
from gcs_cli.actions.action import Action
from gcs_cli.commands.confirmation import YesOption, confirm
from gcs_cli.completion import mode_names
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.link.perform import ask_modes, perform
from gcs_cli.output import Output
from gcs_cli.settings import LinkOptions, output_of
from gcs_cli.vehicle.view_types import VehicleView
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

_NUMBERS = {"ignore_unknown_options": True}
"""Settings of a command with arguments that may be negative."""

_DEFAULT_SPEED = -2.0
_SLOWEST_M_S, _FASTEST_M_S = 0.1, 100.0
_PLACE = (("latitude", -90.0, 90.0), ("longitude", -180.0, 180.0), ("altitude", -20_000.0, 20_000.0))
"""Names and ranges of the numbers of a place."""

AltitudeOption = Annotated[
    float | None,
    typer.Option("--alt", metavar="METRES", min=0.1, max=10_000.0, help="Altitude above home."),
]
TakeoffAltitudeOption = Annotated[
    float | None,
    typer.Option(
        "--alt", metavar="METRES", min=0.1, max=10_000.0,
        help="Altitude above the ground where the vehicle stands; on ArduPilot above home.",
    ),
]  # fmt: skip


@dataclass(frozen=True)
class ActionOptions:
    """Options of all actions."""

    no_wait: Annotated[
        bool,
        typer.Option(
            "--no-wait", help="End with the acknowledgement; do not wait for the effect.", **IN_OUTPUT
        ),
    ] = False


def _check_range(name: str, value: float, low: float, high: float, otherwise: str = "") -> None:
    """Raise CliError (usage) for a number outside its range, also for one that is not finite."""
    if not low <= value <= high:
        raise CliError(
            f"{name}: {plain(value)} is outside the allowed range {plain(low)} to {plain(high)}{otherwise}",
            USAGE,
        )


def run_action(context: typer.Context, link: LinkOptions, options: ActionOptions, action: Action) -> None:
    """Connect, perform ``action`` and print the result."""
    with connect_vehicle(context, link) as connection:
        perform(connection, action, output_of(context, link), waits=not options.no_wait)


@app.command()
@expand_options
def arm(context: typer.Context, link: LinkOptions, options: ActionOptions) -> None:
    """Arm the vehicle."""
    run_action(context, link, options, on_vehicle.arm())


@app.command()
@expand_options
def disarm(
    context: typer.Context,
    link: LinkOptions,
    options: ActionOptions,
    force: Annotated[
        bool, typer.Option("--force", help="Disarm in the air too: the rotors stop. Asks first in the air.")
    ] = False,
    yes: YesOption = False,
) -> None:
    """Disarm the vehicle.

    With --force, in the air, asks first on a terminal; elsewhere it needs --yes.
    """
    with connect_vehicle(context, link) as connection:
        if force and not yes and _may_fly(connection):
            confirm("the vehicle may be in the air, and its rotors will stop", yes, connection)
        perform(
            connection, on_vehicle.disarm(force=force), output_of(context, link), waits=not options.no_wait
        )


def _may_fly(connection: Connection) -> bool:
    """Return True unless the vehicle is disarmed or reports that it is on the ground."""
    connection.wait_for(lambda: connection.session.view.on_ground is not None, _LANDED_STATE_S)
    view = connection.session.view
    return view.armed and view.on_ground is not True


_LANDED_STATE_S = 1.5


@app.command()
@expand_options
def takeoff(
    context: typer.Context, link: LinkOptions, options: ActionOptions, alt: TakeoffAltitudeOption = None
) -> None:
    """Take off; arm first if disarmed.

    Ends when the altitude is reached within 0.5 m. Without --alt the vehicle climbs to its own takeoff altitude, which
    ArduPilot does not have.
    """
    run_action(context, link, options, in_flight.takeoff(alt))


@app.command()
@expand_options
def land(context: typer.Context, link: LinkOptions, options: ActionOptions) -> None:
    """Land at the current position.

    Ends when the vehicle has landed and disarmed.
    """
    run_action(context, link, options, in_flight.land())


@app.command()
@expand_options
def rtl(context: typer.Context, link: LinkOptions, options: ActionOptions) -> None:
    """Return to launch and land.

    Ends when the vehicle has landed and disarmed.
    """
    run_action(context, link, options, in_flight.return_to_launch())


@app.command()
@expand_options
def hold(context: typer.Context, link: LinkOptions, options: ActionOptions) -> None:
    """Stop and hold the position.

    Selects the mode HOLD of PX4, or BRAKE of ArduCopter, which needs no remote control. Ends when the vehicle stands.
    """
    run_action(context, link, options, in_flight.hold())


@app.command(context_settings=_NUMBERS)
@expand_options
def goto(
    context: typer.Context,
    link: LinkOptions,
    options: ActionOptions,
    latitude: Annotated[float, typer.Argument(min=-90.0, max=90.0, help="Degrees.")],
    longitude: Annotated[float, typer.Argument(min=-180.0, max=180.0, help="Degrees.")],
    alt: AltitudeOption = None,
) -> None:
    """Fly to a position and hold there.

    Ends when the vehicle stands there, within 1 m.
    """
    run_action(context, link, options, in_flight.goto(latitude, longitude, alt))


@app.command(context_settings=_NUMBERS)
@expand_options
def yaw(
    context: typer.Context,
    link: LinkOptions,
    options: ActionOptions,
    heading: Annotated[float, typer.Argument(min=0.0, max=360.0, help="Degrees clockwise from north.")],
) -> None:
    """Turn to a heading and hold the position."""
    run_action(context, link, options, in_flight.yaw(heading))


@app.command(context_settings=_NUMBERS)
@expand_options
def speed(
    context: typer.Context,
    link: LinkOptions,
    options: ActionOptions,
    metres_per_second: Annotated[float, typer.Argument(help="Ground speed [m/s]; -2 for the default.")],
) -> None:
    """Set the ground speed until disarmed.

    ArduPilot forgets it with the next mode change. No vehicle reports it: the command ends with the acknowledgement.
    """
    is_default = metres_per_second == _DEFAULT_SPEED
    if not is_default:
        _check_range(
            "speed", metres_per_second, _SLOWEST_M_S, _FASTEST_M_S, f", {_DEFAULT_SPEED:g} is the default"
        )
    run_action(context, link, options, in_flight.speed(None if is_default else metres_per_second))


@app.command()
@expand_options
def mode(
    context: typer.Context,
    link: LinkOptions,
    options: ActionOptions,
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="MODE",
            help="Name or number of the mode; without one, list the modes.",
            autocompletion=mode_names,
        ),
    ] = None,
) -> None:
    """Select a flight mode, or list the modes of the vehicle."""
    with connect_vehicle(context, link) as connection:
        output = output_of(context, link)
        view = connection.session.view
        if name is None:
            is_listed = ask_modes(connection)
            _list_modes(connection.session.view, is_listed, output)
            return
        if view.autopilot.mode_number(name, view.vehicle_type) is None:
            ask_modes(connection)  # the vehicle may have modes of its own
        perform(connection, on_vehicle.select_mode(name), output, waits=not options.no_wait)


def _list_modes(view: VehicleView, is_listed: bool, output: Output) -> None:
    labels = {mode.number: mode.label for mode in view.modes}
    for name, number in on_vehicle.mode_choices(view).items():
        label = labels.get(number, "")
        shown = f"{name.lower():<20} {label}".rstrip()
        output.say(
            "mode",
            shown + (" (current)" if number == view.custom_mode else ""),
            mode=name,
            custom_mode=number,
            label=label or None,
            current=number == view.custom_mode,
            listed_by_vehicle=is_listed,
        )


@app.command("set-home", context_settings=_NUMBERS)
@expand_options
def set_home(
    context: typer.Context,
    link: LinkOptions,
    options: ActionOptions,
    place: Annotated[
        list[float] | None,
        typer.Argument(help="Latitude, longitude, altitude above mean sea level [current position]."),
    ] = None,
) -> None:
    """Set the home position.

    A return goes there, and relative altitudes are measured from it.
    """
    if place and len(place) != 3:
        raise CliError(
            "set-home: give latitude, longitude and altitude, or nothing for the current position", USAGE
        )
    for value, (name, low, high) in zip(place or (), _PLACE, strict=False):
        _check_range(name, value, low, high)
    home = (place[0], place[1], place[2]) if place else None
    run_action(context, link, options, on_vehicle.set_home(home))


app.command("sethome", hidden=True)(set_home)


@app.command()
@expand_options
def terminate(
    context: typer.Context, link: LinkOptions, options: ActionOptions, yes: YesOption = False
) -> None:
    """End the flight at once: the rotors stop and the vehicle falls.

    Asks first on a terminal; elsewhere it needs --yes.
    """
    confirm("the rotors will stop and the vehicle will fall", yes)
    run_action(context, link, options, on_vehicle.terminate())


@app.command()
@expand_options
def inject(
    context: typer.Context,
    link: LinkOptions,
    options: ActionOptions,
    unit: Annotated[str, typer.Argument(help="Unit that fails: motor, gps, gyro, battery …")],
    failure: Annotated[
        str, typer.Argument(help="Kind of failure: off, stuck, garbage, wrong, slow, delayed; ok repairs.")
    ],
    number: Annotated[int, typer.Option("--number", "-n", min=0, metavar="N", help="Which one; 0: all.")] = 0,
) -> None:
    """Inject a failure (MAV_CMD_INJECT_FAILURE).

    The vehicle must allow it: SYS_FAILURE_EN is 1 on PX4. ArduPilot has no such command.
    """
    run_action(context, link, options, on_vehicle.inject_failure(unit, failure, number))


@app.command()
@expand_options
def reboot(context: typer.Context, link: LinkOptions, options: ActionOptions) -> None:
    """Reboot the vehicle, which must be on the ground.

    Ends when the vehicle is back.
    """
    run_action(context, link, options, on_vehicle.reboot())
