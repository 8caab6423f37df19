"""``gcs arm``, ``takeoff``, ``goto``, ``mode`` and similar: one command to the vehicle, one line of output."""

from __future__ import annotations

from typing import Annotated

import typer

from flightstack.process.command_line import expand_options, make_app
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.settings import LinkOptions
from gcs_cli.vehicle.px4_modes import mode_numbers, settable_modes
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

_HOME_WAIT_S = 3.0
_MODES = ", ".join(settable_modes())


@app.command()
@expand_options
def arm(context: typer.Context, link: LinkOptions) -> None:
    """Arm the vehicle."""
    with connect_vehicle(context, link) as connection:
        connection.command(calls.ARM, "arming")
    typer.echo("armed")


@app.command()
@expand_options
def disarm(
    context: typer.Context,
    link: LinkOptions,
    force: Annotated[bool, typer.Option("--force", help="Disarm in the air too: the rotors stop.")] = False,
) -> None:
    """Disarm the vehicle."""
    with connect_vehicle(context, link) as connection:
        connection.command(calls.FORCE_DISARM if force else calls.DISARM, "disarming")
    typer.echo("disarmed")


@app.command()
@expand_options
def takeoff(
    context: typer.Context,
    link: LinkOptions,
    alt: Annotated[
        float | None,
        typer.Option("--alt", metavar="METRES", min=0.1, max=10_000.0, help="Altitude above home."),
    ] = None,
) -> None:
    """Take off; arm first if disarmed."""
    with connect_vehicle(context, link) as connection:
        altitude_amsl_m = calls.NAN if alt is None else alt + _home_altitude_m(connection)
        connection.command(calls.takeoff_command(altitude_amsl_m), "takeoff")
        if not connection.session.view.armed:
            connection.command(calls.ARM, "arming for takeoff")
    typer.echo("taking off" if alt is None else f"taking off to {alt:g} m")


def _home_altitude_m(connection: Connection) -> float:
    """Return the altitude of home above mean sea level, the reference of MAV_CMD_NAV_TAKEOFF."""
    session = connection.session
    if not connection.wait_for(
        lambda: session.view.home is not None or session.view.geo is not None, _HOME_WAIT_S
    ):
        raise CliError("takeoff: the vehicle does not send its position, which --alt needs: leave --alt out")
    if session.view.home is not None:
        return session.view.home.altitude_m
    assert session.view.geo is not None
    return session.view.geo.altitude_m - session.view.geo.relative_altitude_m


@app.command()
@expand_options
def land(context: typer.Context, link: LinkOptions) -> None:
    """Land at the current position."""
    with connect_vehicle(context, link) as connection:
        connection.command(calls.LAND, "landing")
    typer.echo("landing")


@app.command()
@expand_options
def rtl(context: typer.Context, link: LinkOptions) -> None:
    """Return to launch and land."""
    with connect_vehicle(context, link) as connection:
        connection.command(calls.RETURN, "return")
    typer.echo("returning to launch")


@app.command()
@expand_options
def hold(context: typer.Context, link: LinkOptions) -> None:
    """Hold the position."""
    _select_mode(context, link, "hold")


@app.command()
@expand_options
def mode(
    context: typer.Context,
    link: LinkOptions,
    name: Annotated[str, typer.Argument(metavar="MODE", help=f"{_MODES}.")],
) -> None:
    """Select a flight mode."""
    _select_mode(context, link, name)


def _select_mode(context: typer.Context, link: LinkOptions, name: str) -> None:
    numbers = mode_numbers(name)
    if numbers is None:
        raise CliError(f"mode {name}: the vehicle has no such mode; choose one of {_MODES}", USAGE)
    with connect_vehicle(context, link) as connection:
        connection.command(calls.mode_command(*numbers), f"mode {name.lower()}")
    typer.echo(f"mode {name.lower()}")


@app.command()
@expand_options
def goto(
    context: typer.Context,
    link: LinkOptions,
    latitude: Annotated[float, typer.Argument(min=-90.0, max=90.0, help="Degrees.")],
    longitude: Annotated[float, typer.Argument(min=-180.0, max=180.0, help="Degrees.")],
    alt: Annotated[float | None, typer.Option("--alt", metavar="METRES", help="Altitude above home.")] = None,
) -> None:
    """Fly to a position and hold there.

    Put -- before negative degrees.
    """
    with connect_vehicle(context, link) as connection:
        altitude_amsl_m = calls.NAN if alt is None else alt + _home_altitude_m(connection)
        connection.command(calls.goto_command(latitude, longitude, altitude_amsl_m), "goto")
    typer.echo(f"flying to {latitude:.7f} {longitude:.7f}" + ("" if alt is None else f" at {alt:g} m"))


@app.command()
@expand_options
def speed(
    context: typer.Context,
    link: LinkOptions,
    metres_per_second: Annotated[float, typer.Argument(help="Ground speed [m/s]; -2 for the default.")],
) -> None:
    """Set the ground speed until disarmed."""
    with connect_vehicle(context, link) as connection:
        connection.command(calls.speed_command(metres_per_second), "speed")
    typer.echo(
        "flying at the default speed" if metres_per_second < 0.0 else f"flying at {metres_per_second:g} m/s"
    )


@app.command()
@expand_options
def sethome(
    context: typer.Context,
    link: LinkOptions,
    place: Annotated[
        list[float] | None,
        typer.Argument(help="Latitude, longitude, altitude above mean sea level [current position]."),
    ] = None,
) -> None:
    """Set the home position.

    A return goes there, and relative altitudes are measured from it. Put -- before negative degrees.
    """
    if place and len(place) != 3:
        raise CliError(
            "sethome: give latitude, longitude and altitude, or nothing for the current position", USAGE
        )
    home = (place[0], place[1], place[2]) if place else None
    with connect_vehicle(context, link) as connection:
        connection.command(calls.home_command(home), "sethome")
    typer.echo(
        "home is the current position"
        if home is None
        else f"home is {home[0]:.7f} {home[1]:.7f} {home[2]:g} m"
    )


@app.command()
@expand_options
def reboot(context: typer.Context, link: LinkOptions) -> None:
    """Reboot the vehicle, which must be on the ground."""
    with connect_vehicle(context, link) as connection:
        connection.command(calls.REBOOT, "reboot")
    typer.echo("rebooting")
