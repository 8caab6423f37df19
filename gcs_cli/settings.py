"""The flags that all commands share."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from flightstack.core.port_numbers import INSTANCES, system_id
from flightstack.process.console import complain
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link.endpoint import (
    DEFAULT_CONNECTION,
    VEHICLE_CONNECTION,
    Endpoint,
    parse_endpoint,
    vehicle_connection,
)

if TYPE_CHECKING:
    from gcs_cli.link.connection import Connection

DEFAULT_TIMEOUT_S = 5.0

ConnectOption = Annotated[
    str | None,
    typer.Option(
        "--connect",
        metavar="LINK",
        help="Where the vehicle is: udp:PORT, udpin:HOST:PORT or udpout:HOST:PORT.  "
        f"[default: {DEFAULT_CONNECTION}, or {VEHICLE_CONNECTION} while another program listens there]",
        show_default=False,
    ),
]
InstanceOption = Annotated[
    int | None,
    typer.Option(
        "--instance",
        metavar="N",
        min=0,
        max=INSTANCES - 1,
        help="Command the vehicle of `flightstack --instance N`, and no other.",
        show_default=False,
    ),
]
FlownInstanceOption = Annotated[
    int | None,
    typer.Option(
        "--instance",
        metavar="N",
        min=0,
        max=INSTANCES - 1,
        help="Shifts all ports, to fly beside another one.",
    ),
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace what exists already.")]
TimeoutOption = Annotated[
    float | None,
    typer.Option(
        "--timeout",
        metavar="SECONDS",
        help=f"How long to wait for the vehicle.  [default: {DEFAULT_TIMEOUT_S:g}]",
        show_default=False,
    ),
]
SigningKeyOption = Annotated[
    Path | None,
    typer.Option(
        "--signing-key",
        metavar="FILE",
        envvar="GCS_SIGNING_KEY",
        help="Sign with the key in this file, and hear only what is signed with it.",
        show_default=False,
        show_envvar=True,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]


class Settings(NamedTuple):
    """Flags given before the command; None: not given."""

    connect: str | None = None
    timeout_s: float | None = None
    signing_key: Path | None = None
    instance: int | None = None

    def merged(self, connect: str | None, timeout_s: float | None, instance: int | None) -> Settings:
        """Return these with those given after the command, which win."""
        return Settings(
            self.connect if connect is None else connect,
            self.timeout_s if timeout_s is None else timeout_s,
            self.signing_key,
            self.instance if instance is None else instance,
        )

    @property
    def endpoint(self) -> Endpoint:
        """Where the vehicle is; raise CliError (usage)."""
        if self.connect is None and self.instance is not None:
            return parse_endpoint(vehicle_connection(self.instance))
        return parse_endpoint(DEFAULT_CONNECTION if self.connect is None else self.connect)

    @property
    def system_id(self) -> int | None:
        """System id of the vehicle; None for any."""
        return None if self.instance is None else system_id(self.instance)

    @property
    def patience_s(self) -> float:
        """How long to wait for the vehicle; raise CliError (usage)."""
        timeout_s = DEFAULT_TIMEOUT_S if self.timeout_s is None else self.timeout_s
        if not (math.isfinite(timeout_s) and timeout_s > 0):
            raise CliError(f"--timeout {timeout_s:g}: expected seconds above zero", USAGE)
        return timeout_s


def settings_of(context: typer.Context) -> Settings:
    """Return the flags given before the command."""
    found = context.find_object(Settings)
    return Settings() if found is None else found


def open_link(settings: Settings) -> Connection:
    """Open the link to the vehicle; raise CliError.

    While another ground station, `gcs watch` say, listens on the usual port, the vehicle is called at its own.
    """
    from gcs_cli.errors import PortInUseError  # noqa: PLC0415
    from gcs_cli.link.connection import Connection  # noqa: PLC0415
    from gcs_cli.link.signing import open_signing  # noqa: PLC0415

    signing = open_signing(settings.signing_key)
    try:
        return Connection(settings.endpoint, signing=signing, system_id=settings.system_id)
    except PortInUseError as error:
        if settings.connect is not None:
            raise
        other = parse_endpoint(VEHICLE_CONNECTION)
        complain(f"gcs: {error.port} is in use: calling the vehicle at {other}")
        return Connection(other, signing=signing)


def meet_vehicle(
    context: typer.Context, connect: str | None, timeout_s: float | None, instance: int | None
) -> Connection:
    """Open the link and wait for the vehicle; raise CliError."""
    settings = settings_of(context).merged(connect, timeout_s, instance)
    patience_s = settings.patience_s
    connection = open_link(settings)
    try:
        connection.meet(patience_s)
    except BaseException:
        connection.close()
        raise
    return connection
