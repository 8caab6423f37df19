"""Transfers of the vehicle's logs over a connection."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from flightstack.mavlink.fields import REPLACEMENT
from flightstack.mavlink.files import Entry
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
from gcs_cli.clients.log_client import LogClient, LogDone, LogEntry, LogFailed
from gcs_cli.errors import FAILED, NO_ANSWER, CliError
from gcs_cli.link.calls import vehicle_address
from gcs_cli.link.connection import Connection

LOG_FOLDER = "@MAV_LOG"
"""Directory of the logs on MAVLink FTP."""
FTP_WAIT_S = 1.5
"""Timeout of the directory; many vehicles never answer."""

Progress: TypeAlias = Callable[[int, int], None]
"""Called with the received bytes and their total."""


def fetch_list(connection: Connection) -> tuple[LogEntry, ...]:
    """Return all logs of the vehicle, the oldest first; raise CliError."""
    client = _log_client(connection, "log list")
    client.start_list()
    connection.run(client, "log list")
    if isinstance(client.result, LogDone):
        return oldest_first(client.result.entries)
    raise _error(client.result, "log list")


def oldest_first(logs: tuple[LogEntry, ...]) -> tuple[LogEntry, ...]:
    """Return logs by their time, or by their number if a time is unknown: PX4 numbers them in no order."""
    return (
        tuple(sorted(logs, key=lambda log: log.time_utc_s)) if all(log.time_utc_s for log in logs) else logs
    )


def kept_logs(before: tuple[LogEntry, ...], after: tuple[LogEntry, ...]) -> tuple[LogEntry, ...]:
    """Return the logs that an erase has left; a smaller one of the same number began since, as on ArduPilot."""
    sizes = {log.log_id: log.size for log in before}
    return tuple(log for log in after if log.size >= sizes.get(log.log_id, log.size + 1))


def erase_logs(connection: Connection, before: int) -> tuple[LogEntry, ...]:
    """Erase the ``before`` logs of the vehicle; return those that are left; raise CliError."""
    client = _log_client(connection, "log erase")
    client.start_erase(before)
    connection.run(client, "log erase")
    if isinstance(client.result, LogDone):
        return client.result.entries
    raise _error(client.result, "log erase")


def fetch_files(connection: Connection) -> tuple[Entry, ...]:
    """Return the logs on the vehicle's MAVLink FTP; none if it does not support that."""
    client = _ftp_client(connection)
    client.start_list(LOG_FOLDER)
    connection.run(client, "log list", timeout_s=FTP_WAIT_S)
    if not isinstance(client.result, FtpDone):
        return ()
    return tuple(entry for entry in client.result.entries if is_plain_name(entry.name))


def file_of(log: LogEntry, logs: tuple[LogEntry, ...], files: tuple[Entry, ...]) -> Entry | None:
    """Return the file of ``log``, or None: numbers and names are matched by a size that is unique.

    A log that is being written may have grown between the two lists: the only one without a file of its size has the
    only file without a log.
    """
    log_sizes, file_sizes = [entry.size for entry in logs], [file.size for file in files]
    if log_sizes.count(log.size) != 1:
        return None
    found = [file for file in files if file.size == log.size]
    if not found and [size in file_sizes for size in log_sizes].count(False) == 1:
        found = [file for file in files if file.size not in log_sizes and (file.size or 0) > log.size]
    return found[0] if len(found) == 1 else None


def is_growing(connection: Connection, log: LogEntry, logs: tuple[LogEntry, ...]) -> bool | None:
    """Return True if the vehicle still writes ``log``: the newest one of an armed vehicle, or one that has grown.

    None if the vehicle does not answer.
    """
    if log != logs[-1]:
        return False
    if connection.session.view.armed:
        return True
    try:
        now = fetch_list(connection)
    except CliError:
        return None
    return any(entry.log_id == log.log_id and entry.size > log.size for entry in now)


def fetch_log(connection: Connection, log: LogEntry, file: Entry | None, show: Progress) -> bytes:
    """Return the content of ``log``, over MAVLink FTP if ``file`` is known, which is faster; raise CliError."""
    name = f"log {log.log_id}"
    if file is not None:
        over_ftp = _ftp_client(connection)
        over_ftp.start_download(f"{LOG_FOLDER}/{file.name}")
        connection.run(over_ftp, name, show=show)
        if isinstance(over_ftp.result, FtpDone):
            return over_ftp.result.content
    client = _log_client(connection, name)
    client.start_download(log)
    connection.run(client, name, show=show)
    if isinstance(client.result, LogDone):
        return client.result.content
    raise _error(client.result, name)


def is_plain_name(name: str) -> bool:
    """Return True if a name from the vehicle is safe as a file name: no path, not hidden, no replaced characters."""
    return (
        bool(name)
        and name.isprintable()
        and not name.startswith(".")
        and not set(name) & {*"/\\:", REPLACEMENT}
    )


def _error(result: object, name: str) -> CliError:
    if isinstance(result, LogFailed):
        return CliError(f"{name}: {result.reason}", NO_ANSWER if result.silent else FAILED)
    return CliError(f"{name}: the vehicle did not answer", NO_ANSWER)


def _log_client(connection: Connection, name: str) -> LogClient:
    session = connection.session
    autopilot = session.view.autopilot
    if session.view.armed and not autopilot.sends_logs_armed:
        raise CliError(
            f"{name} refused: {autopilot.title} sends no logs while it is armed: disarm it first", FAILED
        )
    return LogClient(vehicle_address(session), is_silent_without_logs=autopilot.is_silent_without_logs)


def _ftp_client(connection: Connection) -> FtpClient:
    return FtpClient(vehicle_address(connection.session), connection.session.own)
