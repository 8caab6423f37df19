"""Open the link to the vehicle with the options of a command, and follow what it sends."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.port_numbers import api_client_port, tcp_port
from flightstack.mavlink.signing import LinkSigning
from flightstack.process.command_line import IN_OUTPUT
from flightstack.process.console import complain
from flightstack.process.signing_file import open_shared_signing
from gcs_cli.errors import USAGE, CliError, PortInUseError
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import (
    LOOPBACK,
    RECORDING,
    SERIAL,
    TCP,
    TCP_IN,
    UDP_IN,
    VEHICLE_CONNECTION,
    VehicleEndpoint,
    parse_endpoint,
)
from gcs_cli.link.lines import Line
from gcs_cli.link.opening import SeveralLines, open_line, opened_lines
from gcs_cli.link.share import open_shared
from gcs_cli.settings import LinkOptions, given_options, link_options, settings_of, signing_key_of

OTHER_CONNECTIONS = (
    VEHICLE_CONNECTION,
    f"udpin:{LOOPBACK}:{api_client_port(0)}",
    f"tcp:{LOOPBACK}:{tcp_port(0)}",
)
"""Where a vehicle of this machine may answer that sends to another ground station at the default port, or to none.

Our vehicle answers any client at its own port. PX4 answers one client there, and sends to the port of API clients.
ArduPilot's simulation listens on TCP.
"""

SHARED_KINDS = (UDP_IN, TCP, TCP_IN, SERIAL)
"""Kinds of links that one process at a time can open."""

LONGEST_S = 1e7
_STEP_S = 0.1

DurationOption = Annotated[
    float | None,
    typer.Option(
        "--duration",
        metavar="SECONDS",
        min=0.0,
        max=LONGEST_S,
        help="End after this time.  [default: at Ctrl-C]",
        show_default=False,
        **IN_OUTPUT,
    ),
]


def open_signing(key: Path | None) -> LinkSigning | None:
    """Return signing with the key in the file ``key``, or None without one; raise ConfigError."""
    return None if key is None else open_shared_signing(key, "gcs")


def open_link(
    context: typer.Context,
    options: LinkOptions,
    *,
    takes_recording: bool = False,
    in_real_time: bool = True,
    shares: bool = False,
) -> Connection:
    """Open the link to the vehicle; raise CliError.

    If another ``gcs`` shares the link, use it. If another ground station listens on the default port, search the
    vehicle at ``OTHER_CONNECTIONS``. A command that only shows what the vehicle sends ``takes_recording``-s, played in
    real time or at once. A command that runs long ``shares`` its link.
    """
    link = link_options(context, options)
    endpoint = link.endpoint
    if endpoint.kind == RECORDING and not takes_recording:
        raise CliError(f"{command_name(context)}: {endpoint} is a recording, which takes no commands", USAGE)
    signing = open_signing(signing_key_of(context))
    line = open_shared(endpoint) if endpoint.kind in SHARED_KINDS else None
    if line is None and link.is_default:
        endpoint, line = _default_line(endpoint)
    connection = Connection(
        endpoint, signing=signing, system_id=link.system_id, line=line, in_real_time=in_real_time
    )
    if shares and endpoint.kind in SHARED_KINDS:
        connection.share()
    return connection


def _default_line(endpoint: VehicleEndpoint) -> tuple[VehicleEndpoint, Line]:
    others = [parse_endpoint(text) for text in OTHER_CONNECTIONS]
    try:
        return endpoint, SeveralLines({endpoint: open_line(endpoint)}, later=others)
    except PortInUseError as error:
        complain(f"gcs: {error.port} is in use: trying {', '.join(str(other) for other in others)}")
        return others[0], SeveralLines(opened_lines(others))


def command_name(context: typer.Context) -> str:
    """Return the words of the command, such as ``mission upload``."""
    return context.command_path.partition(" ")[2] or context.command_path


def connect_vehicle(
    context: typer.Context,
    options: LinkOptions,
    *,
    takes_recording: bool = False,
    in_real_time: bool = True,
    shares: bool = False,
    several: bool = False,
    record: Callable[[bytes], None] | None = None,
) -> Connection:
    """Open the link, or use that of the shell, and wait for the vehicle; raise CliError that names the command.

    With ``several``, the link may have several vehicles although none was chosen. ``record`` gets every frame, those
    that are exchanged during the wait too.
    """
    lent = settings_of(context).lent
    if lent is not None and given_options(context, options).is_default:
        connection = lent
        lent.fleet.choose(given_options(context, options).system)
    else:
        connection = open_link(
            context, options, takes_recording=takes_recording, in_real_time=in_real_time, shares=shares
        )
    connection.fleet.wire.record = record
    try:
        connection.wait_for_vehicle(link_options(context, options).timeout_s, several=several)
    except BaseException as error:
        connection.__exit__()
        if isinstance(error, CliError):
            raise CliError(f"{command_name(context)}: {error}", error.exit_code) from None
        raise
    return connection


def follow(connection: Connection, duration_s: float | None, has_ended: Callable[[], bool]) -> None:
    """Exchange messages until ``has_ended``, for ``duration_s``, to the end of a recording, or until Ctrl-C.

    ``has_ended`` is called after each step.
    """
    end_s = math.inf if duration_s is None else connection.now_s + duration_s
    try:
        while not has_ended() and connection.now_s < end_s and not connection.ended:
            connection.step(min(end_s, connection.now_s + _STEP_S))
        has_ended()
    except KeyboardInterrupt:
        return
