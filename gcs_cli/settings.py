"""The options that commands share."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flightstack.core.port_numbers import INSTANCES, system_id
from flightstack.process.command_line import IN_LINKS, IN_OUTPUT
from gcs_cli.config_file import (
    LARGEST_SYSTEM_ID,
    LONGEST_TIMEOUT_S,
    SHORTEST_TIMEOUT_S,
    Config,
    load_config,
)
from gcs_cli.errors import USAGE, CliError
from gcs_cli.link.endpoint import (
    DEFAULT_CONNECTION,
    FORMS,
    VehicleEndpoint,
    parse_endpoint,
    vehicle_connection,
)
from gcs_cli.output import Output

if TYPE_CHECKING:
    from flightstack.process.supervised import PreparedPrograms
    from gcs_cli.link.connection import Connection

DEFAULT_TIMEOUT_S = 5.0
_TIMEOUT: dict[str, Any] = {"metavar": "SECONDS", "min": SHORTEST_TIMEOUT_S, "max": LONGEST_TIMEOUT_S}
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


def _json_before_too(context: typer.Context, given: bool) -> bool:
    return given or settings_of(context).link.as_json


JsonOption = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object a line.", callback=_json_before_too, **IN_OUTPUT),
]
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
    """The vehicle to connect to, and the form of the output; None: not given."""

    connect: Annotated[
        str | None,
        typer.Option(
            "--connect",
            metavar="LINK",
            help=f"Address of the vehicle: {FORMS}. Also in GCS_CONNECT and the configuration file.  "
            f"[default: {DEFAULT_CONNECTION}, or where else a vehicle of this machine answers]",
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
    system: Annotated[
        int | None,
        typer.Option(
            "--system",
            metavar="ID",
            min=1,
            max=LARGEST_SYSTEM_ID,
            help="Command the vehicle with this MAVLink system id; needed if there are several on the link.",
            show_default=False,
        ),
    ] = None
    as_json: JsonOption = False

    @property
    def endpoint(self) -> VehicleEndpoint:
        """Address of the vehicle; raise CliError (usage)."""
        if self.connect is None and self.instance is not None:
            return parse_endpoint(vehicle_connection(self.instance))
        return parse_endpoint(DEFAULT_CONNECTION if self.connect is None else self.connect)

    @property
    def is_default(self) -> bool:
        """True if the user named no link."""
        return self.connect is None and self.instance is None

    @property
    def system_id(self) -> int | None:
        """System id of the vehicle; None for any."""
        if self.system is not None:
            return self.system
        return None if self.instance is None else system_id(self.instance)

    @property
    def timeout_s(self) -> float:
        """Timeout of the wait for the vehicle [s]."""
        return DEFAULT_TIMEOUT_S if self.timeout is None else self.timeout


@dataclass(frozen=True)
class Settings:
    """The options that are given before the command."""

    link: LinkOptions = LinkOptions()
    signing_key: Path | None = None
    lent: Connection | None = None
    """The open link of a shell, for commands that name no other link."""
    prepared: PreparedPrograms | None = None
    """Simulator and flight stack of the command, if they were started before the command was imported."""


def settings_of(context: typer.Context) -> Settings:
    """Return the options that are given before the command."""
    found = context.find_object(Settings)
    return Settings() if found is None else found


def given_options(context: typer.Context, given: LinkOptions) -> LinkOptions:
    """Return the options ``given`` after the command, completed by those before it."""
    before = settings_of(context).link
    return LinkOptions(
        before.connect if given.connect is None else given.connect,
        before.timeout if given.timeout is None else given.timeout,
        before.instance if given.instance is None else given.instance,
        before.system if given.system is None else given.system,
        before.as_json or given.as_json,
    )


def link_options(context: typer.Context, given: LinkOptions) -> LinkOptions:
    """Return the link to use: options before the environment before the configuration file; raise ConfigError."""
    return completed(given_options(context, given), os.environ.get("GCS_CONNECT") or None, load_config())


def completed(link: LinkOptions, connect: str | None, config: Config) -> LinkOptions:
    """Return ``link`` with missing values from the environment's ``connect`` and the configuration file.

    An instance is an address too: other addresses do not replace it.
    """
    if link.is_default:
        link = replace(link, connect=connect or config.connect)
    return replace(
        link,
        timeout=config.timeout if link.timeout is None else link.timeout,
        system=config.system if link.system_id is None else link.system,
    )


def signing_key_of(context: typer.Context) -> Path | None:
    """Return the file of the signing key, of the option or the configuration file; raise ConfigError."""
    return settings_of(context).signing_key or load_config().signing_key


def output_of(context: typer.Context, given: LinkOptions | bool) -> Output:
    """Return the output in the form that ``given``, or an option before the command, asks for."""
    as_json = given if isinstance(given, bool) else given.as_json
    return Output(as_json or settings_of(context).link.as_json)


def check_output_file(flag: str, path: Path | None, suffixes: tuple[str, ...]) -> None:
    """Raise CliError (usage) for a file of another kind, or in a directory that does not exist."""
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise CliError(f"{flag} {path}: give the file a name that ends in {suffixes[0]}", USAGE)
    if not path.parent.is_dir():
        raise CliError(f"{flag} {path}: there is no directory {path.parent}", USAGE)


def check_page(page: Path) -> None:
    """Raise CliError (usage) for a page of ``--out`` that is no page, or in a directory that does not exist."""
    if page.suffix.lower() not in (".html", ".htm"):
        raise CliError(f"--out {page}: give the page a name that ends in .html", USAGE)
    if not page.parent.is_dir():
        raise CliError(f"--out {page}: there is no directory {page.parent}", USAGE)
