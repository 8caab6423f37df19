"""``gcs arm``, ``takeoff``, ``goto``, ``mode`` and their like: one command, one line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from gcs_cli.errors import USAGE, CliError
from gcs_cli.settings import ConnectOption, InstanceOption, TimeoutOption, meet_vehicle
from gcs_cli.vehicle.px4_modes import mode_numbers, settable_modes

if TYPE_CHECKING:
    from gcs_cli.link.connection import Connection


def order(connection: Connection, command: tuple[int, Sequence[float]], name: str) -> None:
    """Send a command and wait for its answer; raise CliError with the vehicle's reason."""
    from gcs_cli.link import calls  # noqa: PLC0415

    number, params = command
    connection.complete(calls.command(connection.session, number, params, connection.now_s), name)


def arm(
    context: typer.Context,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Arm the vehicle."""
    from gcs_cli.link import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
        order(connection, calls.ARM, "arming")
    typer.echo("armed")


def disarm(
    context: typer.Context,
    force: Annotated[bool, typer.Option("--force", help="Also in the air: the rotors stop.")] = False,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Disarm the vehicle."""
    from gcs_cli.link import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
        order(connection, calls.FORCE_DISARM if force else calls.DISARM, "disarming")
    typer.echo("disarmed")


def takeoff(
    context: typer.Context,
    alt: Annotated[float | None, typer.Option("--alt", metavar="METRES", help="Altitude above home.")] = None,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Take off; a disarmed vehicle is armed for it."""
    from gcs_cli.link import calls  # noqa: PLC0415

    if alt is not None and not 0.0 < alt < 1e4:
        raise CliError(f"--alt {alt:g}: expected metres above zero", USAGE)
    with meet_vehicle(context, connect, timeout, instance) as connection:
        altitude_amsl_m = calls.NAN if alt is None else alt + _home_altitude_m(connection)
        order(connection, calls.takeoff_command(altitude_amsl_m), "takeoff")
        if not connection.session.view.armed:
            order(connection, calls.ARM, "arming for takeoff")
    typer.echo("taking off" if alt is None else f"taking off to {alt:g} m")


def _home_altitude_m(connection: Connection) -> float:
    """Return home's altitude above sea level, in which the takeoff command counts."""
    session = connection.session
    if not connection.wait_for(lambda: session.view.home is not None or session.view.geo is not None, 3.0):
        raise CliError("takeoff: the vehicle does not tell its position, and --alt needs it; leave it out")
    if session.view.home is not None:
        return session.view.home.altitude_m
    assert session.view.geo is not None
    return session.view.geo.altitude_m - session.view.geo.relative_altitude_m


def land(
    context: typer.Context,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Land where the vehicle is."""
    from gcs_cli.link import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
        order(connection, calls.LAND, "landing")
    typer.echo("landing")


def rtl(
    context: typer.Context,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Return to launch and land."""
    from gcs_cli.link import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
        order(connection, calls.RETURN, "return")
    typer.echo("returning to launch")


def hold(
    context: typer.Context,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Hold the position."""
    mode(context, "hold", connect, timeout, instance)


def mode(
    context: typer.Context,
    name: Annotated[str, typer.Argument(help="hold, mission, takeoff, land, rtl …")],
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Select a flight mode."""
    numbers = mode_numbers(name)
    if numbers is None:
        known = ", ".join(settable_modes()).lower()
        raise CliError(f"mode {name}: there is none; known are {known}", USAGE)
    from gcs_cli.link import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
        order(connection, calls.mode_command(*numbers), f"mode {name.lower()}")
    typer.echo(f"mode {name.lower()}")


def goto(
    context: typer.Context,
    latitude: Annotated[float, typer.Argument(help="Degrees.")],
    longitude: Annotated[float, typer.Argument(help="Degrees.")],
    alt: Annotated[float | None, typer.Option("--alt", metavar="METRES", help="Altitude above home.")] = None,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Fly to a place and hold there.

    Put -- before negative degrees.
    """
    from gcs_cli.link import calls  # noqa: PLC0415

    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise CliError(f"goto {latitude:g} {longitude:g}: not a place on earth", USAGE)
    with meet_vehicle(context, connect, timeout, instance) as connection:
        altitude_amsl_m = calls.NAN if alt is None else alt + _home_altitude_m(connection)
        order(connection, calls.goto_command(latitude, longitude, altitude_amsl_m), "goto")
    typer.echo(f"flying to {latitude:.7f} {longitude:.7f}" + ("" if alt is None else f" at {alt:g} m"))


def speed(
    context: typer.Context,
    metres_per_second: Annotated[float, typer.Argument(help="Ground speed [m/s]; -2 for the usual one.")],
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Fly at another speed until disarmed."""
    from gcs_cli.link import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
        order(connection, calls.speed_command(metres_per_second), "speed")
    typer.echo(
        "flying at the usual speed" if metres_per_second < 0.0 else f"flying at {metres_per_second:g} m/s"
    )


def sethome(
    context: typer.Context,
    place: Annotated[
        list[float] | None, typer.Argument(help="Latitude, longitude, altitude above the sea [here].")
    ] = None,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Move home, where a return goes.

    Altitudes count from there. Put -- before negative degrees.
    """
    from gcs_cli.link import calls  # noqa: PLC0415

    if place and len(place) != 3:
        raise CliError("sethome: give latitude, longitude and altitude, or nothing for here", USAGE)
    target = (place[0], place[1], place[2]) if place else None
    with meet_vehicle(context, connect, timeout, instance) as connection:
        order(connection, calls.home_command(target), "sethome")
    typer.echo(
        "home is here" if target is None else f"home is {target[0]:.7f} {target[1]:.7f} {target[2]:g} m"
    )


def reboot(
    context: typer.Context,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
    instance: InstanceOption = None,
) -> None:
    """Reboot the vehicle, which must stand on the ground."""
    from gcs_cli.link import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout, instance) as connection:
        order(connection, calls.REBOOT, "reboot")
    typer.echo("rebooting")


ACTIONS: tuple[Callable[..., None], ...] = (
    arm, disarm, takeoff, land, rtl, hold, goto, speed, sethome, mode, reboot,
)  # fmt: skip
