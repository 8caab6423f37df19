"""The options that commands share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from flightstack.core.port_numbers import INSTANCES, system_id
from flightstack.process.command_line import IN_LINKS, IN_OUTPUT
from gcs_cli.link.endpoint import (
    DEFAULT_CONNECTION,
    VEHICLE_CONNECTION,
    VehicleEndpoint,
    parse_endpoint,
    vehicle_connection,
)

DEFAULT_TIMEOUT_S = 5.0
_TIMEOUT: dict[str, Any] = {"metavar": "SECONDS", "min": 0.1, "max": 86_400.0}
_INSTANCE: dict[str, Any] = {"metavar": "N", "min": 0, "max": INSTANCES - 1, "show_default": False}

FlownInstanceOption = Annotated[
    int | None,
    typer.Option("--instance", help="Shifts all ports, to fly beside another one.", **_INSTANCE, **IN_LINKS),
]
FlownTimeoutOption = Annotated[
    float | None,
    typer.Option("--timeout", help="Wait for the vehicle.  [default: 180]", **_TIMEOUT, **IN_LINKS),
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace existing files.", **IN_OUTPUT)]
OpenOption = Annotated[bool, typer.Option("--open", help="Open the report afterwards.", **IN_OUTPUT)]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.", **IN_OUTPUT)]
SigningKeyOption = Annotated[
    Path | None,
    typer.Option(
        "--signing-key",
        metavar="FILE",
        envvar="GCS_SIGNING_KEY",
        help="Sign messages with the key in this file, and accept only messages signed with it.",
        show_default=False,
        show_envvar=True,
    ),
]


@dataclass(frozen=True)
class LinkOptions:
    """The vehicle to connect to; None: not given."""

    connect: Annotated[
        str | None,
        typer.Option(
            "--connect",
            metavar="LINK",
            help="Address of the vehicle: udp:PORT, udpin:HOST:PORT or udpout:HOST:PORT.  "
            f"[default: {DEFAULT_CONNECTION}, or {VEHICLE_CONNECTION} while another program listens there]",
            show_default=False,
        ),
    ] = None
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout",
            help=f"How long to wait for the vehicle.  [default: {DEFAULT_TIMEOUT_S:g}]",
            show_default=False,
            **_TIMEOUT,
        ),
    ] = None
    instance: Annotated[
        int | None,
        typer.Option(
            "--instance", help="Command the vehicle of `flightstack --instance N`, and no other.", **_INSTANCE
        ),
    ] = None

    @property
    def endpoint(self) -> VehicleEndpoint:
        """Address of the vehicle; raise CliError (usage)."""
        if self.connect is None and self.instance is not None:
            return parse_endpoint(vehicle_connection(self.instance))
        return parse_endpoint(DEFAULT_CONNECTION if self.connect is None else self.connect)

    @property
    def system_id(self) -> int | None:
        """System id of the vehicle; None for any."""
        return None if self.instance is None else system_id(self.instance)

    @property
    def timeout_s(self) -> float:
        """How long to wait for the vehicle [s]."""
        return DEFAULT_TIMEOUT_S if self.timeout is None else self.timeout


@dataclass(frozen=True)
class Settings:
    """The options that are given before the command."""

    link: LinkOptions = LinkOptions()
    signing_key: Path | None = None


def settings_of(context: typer.Context) -> Settings:
    """Return the options that are given before the command."""
    found = context.find_object(Settings)
    return Settings() if found is None else found


def link_options(context: typer.Context, given: LinkOptions) -> LinkOptions:
    """Return the options ``given`` after the command, completed by those before it."""
    before = settings_of(context).link
    return LinkOptions(
        before.connect if given.connect is None else given.connect,
        before.timeout if given.timeout is None else given.timeout,
        before.instance if given.instance is None else given.instance,
    )
