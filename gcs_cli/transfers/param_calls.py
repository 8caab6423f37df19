"""Transfers of parameters over a connection."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeAlias

from flightstack.core.enums import Severity
from flightstack.mavlink.param_values import Parameter
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
from gcs_cli.clients.param_client import ParamClient, ParamDone, ParamFailed, ParamTiming
from gcs_cli.errors import FAILED, NO_ANSWER, CliError
from gcs_cli.link.calls import TEXT_WAIT_S, vehicle_address
from gcs_cli.link.connection import Connection
from gcs_cli.vehicle.param_info import METADATA_PATH, ParamInfo, number_text, parse_metadata

METADATA_SILENCE_S = 3.0
"""Longest time without progress of the download of the metadata; many vehicles have none, and do not answer."""
TIMING = ParamTiming()
Progress: TypeAlias = Callable[[int, int], None]
"""Called with the transferred parameters and their total."""


class Changes(NamedTuple):
    """Result of setting several parameters."""

    changed: tuple[Parameter, ...]
    failures: tuple[str, ...]
    """The reasons of those that were not set."""
    is_undone: bool = False
    """True if a refused parameter has undone the change of the others."""


def fetch_all(connection: Connection, show: Progress | None = None) -> tuple[Parameter, ...]:
    """Return all parameters, sorted by name; raise CliError. ``show`` gets the received number and the total."""
    client = _param_client(connection)
    client.start_list()
    connection.run(client, "the parameter list", show=show)
    if isinstance(client.result, ParamDone):
        return tuple(sorted(client.result.parameters))
    raise _error(client.result, "parameters")


def fetch(connection: Connection, name: str) -> Parameter:
    """Return one parameter; raise CliError."""
    client = _param_client(connection)
    client.start_get(name)
    connection.run(client, name)
    if isinstance(client.result, ParamDone):
        return client.result.parameters[0]
    raise _error(client.result, name)


def change(connection: Connection, name: str, value: float) -> Parameter:
    """Set a parameter and return it as the vehicle confirmed it; raise CliError with the vehicle's reason."""
    texts_before = connection.session.view.text_count
    client = _param_client(connection)
    client.start_set(name, value)
    connection.run(client, name)
    result = client.result
    if isinstance(result, ParamDone):
        return result.parameters[0]
    if isinstance(result, ParamFailed) and not result.silent:
        said = _explanation(connection, name, texts_before)
        result = result if said is None else result._replace(reason=said)
    raise _error(result, f"{name} = {number_text(value)}")


def change_all(
    connection: Connection,
    wanted: Mapping[str, float],
    present: Mapping[str, Parameter],
    show: Progress | None = None,
) -> Changes:
    """Set the parameters that differ from ``present``: all that the vehicle has, or none if it refuses one.

    Raise CliError if the vehicle does not answer, or if another one is selected meanwhile.
    """
    unknown = [f"{name}: the vehicle has no such parameter" for name in wanted if name not in present]
    settable = wanted.keys() & present.keys() - connection.session.view.autopilot.counters
    different = {
        name: value
        for name, value in wanted.items()
        if name in settable and number_text(present[name].value) != number_text(value)
    }
    changed, refused = _change_in_any_order(connection, different, show)
    if not refused:
        return Changes(tuple(changed), tuple(unknown))
    before = {parameter.name: present[parameter.name].value for parameter in changed}
    _, kept = _change_in_any_order(connection, before, None)
    return Changes((), (*unknown, *refused, *kept), is_undone=True)


def _change_in_any_order(
    connection: Connection, wanted: Mapping[str, float], show: Progress | None
) -> tuple[list[Parameter], list[str]]:
    """Set parameters, refused ones again after the others, which may limit them; return changes and refusals."""
    session, left = connection.session, dict(wanted)
    changed = list[Parameter]()
    while True:
        refused = dict[str, str]()
        for name, value in left.items():
            if show is not None:
                show(len(changed) + len(refused) + 1, len(wanted))
            if connection.session is not session:
                raise CliError(f"{name}: vehicle {session.target[0]} is no longer selected")
            try:
                changed.append(change(connection, name, value))
            except CliError as error:
                if error.exit_code != FAILED:
                    raise
                refused[name] = str(error)
        if len(refused) in (0, len(left)):
            return changed, list(refused.values())
        left = {name: wanted[name] for name in refused}


def fetch_metadata(connection: Connection) -> dict[str, ParamInfo]:
    """Return the metadata of the vehicle's parameters, by name; empty if it sends none."""
    client = FtpClient(vehicle_address(connection.session), connection.session.own, METADATA_SILENCE_S)
    client.start_download(METADATA_PATH)
    connection.run(client, "parameter metadata")
    return parse_metadata(client.result.content) if isinstance(client.result, FtpDone) else {}


def _explanation(connection: Connection, name: str, texts_before: int) -> str | None:
    """Return the vehicle's STATUSTEXT about refusing ``name``, which follows the answer."""
    prefix = f"Parameter {name} refused: "

    def said() -> str | None:
        texts = connection.session.view.texts_since(texts_before)
        found = [
            text.text for text in texts if text.severity <= Severity.WARNING and text.text.startswith(prefix)
        ]
        return found[-1].removeprefix(prefix) if found else None

    connection.wait_for(lambda: said() is not None, TEXT_WAIT_S)
    return said()


def _error(result: object, what: str) -> CliError:
    if not isinstance(result, ParamFailed):
        return CliError(f"{what}: the vehicle did not answer", NO_ANSWER)
    if result.silent:
        return CliError(f"{what}: {result.reason}", NO_ANSWER)
    return CliError(f"{what} refused: {result.reason}", FAILED)


def _param_client(connection: Connection) -> ParamClient:
    session = connection.session
    casts = session.view.autopilot.casts_parameters
    return ParamClient(vehicle_address(session), session.own, TIMING, casts=casts)
