"""``gcs arm``, ``disarm``, ``takeoff``, ``land``, ``rtl``, ``hold`` and ``mode``: one command, one line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from gcs_cli.errors import USAGE, CliError
from gcs_cli.px4_modes import mode_numbers, settable_modes
from gcs_cli.settings import ConnectOption, TimeoutOption, meet_vehicle

if TYPE_CHECKING:
    from gcs_cli.connection import Connection


def order(connection: Connection, command: tuple[int, Sequence[float]], name: str) -> None:
    """Send a command and wait for its answer; raise CliError with the vehicle's reason."""
    from gcs_cli import calls  # noqa: PLC0415

    number, params = command
    connection.complete(calls.command(connection.session, number, params, connection.now_s), name)


def arm(context: typer.Context, connect: ConnectOption = None, timeout: TimeoutOption = None) -> None:
    """Arm the vehicle."""
    from gcs_cli import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout) as connection:
        order(connection, calls.ARM, "arming")
    typer.echo("armed")


def disarm(
    context: typer.Context,
    force: Annotated[bool, typer.Option("--force", help="Also in the air: the rotors stop.")] = False,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
) -> None:
    """Disarm the vehicle."""
    from gcs_cli import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout) as connection:
        order(connection, calls.FORCE_DISARM if force else calls.DISARM, "disarming")
    typer.echo("disarmed")


def takeoff(
    context: typer.Context,
    alt: Annotated[float | None, typer.Option("--alt", metavar="METRES", help="Altitude above home.")] = None,
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
) -> None:
    """Take off; a disarmed vehicle is armed for it."""
    from gcs_cli import calls  # noqa: PLC0415

    if alt is not None and not 0.0 < alt < 1e4:
        raise CliError(f"--alt {alt:g}: expected metres above zero", USAGE)
    with meet_vehicle(context, connect, timeout) as connection:
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


def land(context: typer.Context, connect: ConnectOption = None, timeout: TimeoutOption = None) -> None:
    """Land where the vehicle is."""
    from gcs_cli import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout) as connection:
        order(connection, calls.LAND, "landing")
    typer.echo("landing")


def rtl(context: typer.Context, connect: ConnectOption = None, timeout: TimeoutOption = None) -> None:
    """Return to launch and land."""
    from gcs_cli import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout) as connection:
        order(connection, calls.RETURN, "return")
    typer.echo("returning to launch")


def hold(context: typer.Context, connect: ConnectOption = None, timeout: TimeoutOption = None) -> None:
    """Hold the position."""
    mode(context, "hold", connect, timeout)


def mode(
    context: typer.Context,
    name: Annotated[str, typer.Argument(help="hold, mission, takeoff, land, rtl …")],
    connect: ConnectOption = None,
    timeout: TimeoutOption = None,
) -> None:
    """Select a flight mode."""
    numbers = mode_numbers(name)
    if numbers is None:
        known = ", ".join(settable_modes()).lower()
        raise CliError(f"mode {name}: there is none; known are {known}", USAGE)
    from gcs_cli import calls  # noqa: PLC0415

    with meet_vehicle(context, connect, timeout) as connection:
        order(connection, calls.mode_command(*numbers), f"mode {name.lower()}")
    typer.echo(f"mode {name.lower()}")


ACTIONS: tuple[Callable[..., None], ...] = (arm, disarm, takeoff, land, rtl, hold, mode)
