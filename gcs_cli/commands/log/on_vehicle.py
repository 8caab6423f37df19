"""``gcs log list|download|erase``: the logs on the vehicle."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from flightstack.core.atomic_file import check_new, write_bytes_atomically
from flightstack.mavlink.files import Entry
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.autopilots.registry import autopilot_of
from gcs_cli.clients.log_client import LogEntry
from gcs_cli.commands.confirmation import YesOption, confirm
from gcs_cli.errors import FAILED, USAGE, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.output import Output
from gcs_cli.settings import LinkOptions, OverwriteOption, output_of
from gcs_cli.transfers import log_calls
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

_KILO = 1000.0


@app.command("list")
@expand_options
def list_logs(
    context: typer.Context,
    link: LinkOptions,
) -> None:
    """List the logs, the oldest first."""
    with connect_vehicle(context, link) as connection:
        logs = log_calls.fetch_list(connection)
        files = log_calls.fetch_files(connection) if logs else ()
    named = [(log, log_calls.file_of(log, logs, files)) for log in logs]
    out = output_of(context, link)
    if not logs and not out.as_json:
        typer.echo("the vehicle has no logs")
    for log, file in named:
        line = f"{log.log_id:5d}  {_time_text(log):<20}  {size_text(log.size):>9}"
        out.say("log", f"{line}  {file.name}" if file is not None else line, **_facts(log, file))


@app.command()
@expand_options
def download(
    context: typer.Context,
    link: LinkOptions,
    log_id: Annotated[
        str, typer.Argument(metavar="[ID|latest]", help="Which log.", show_default=False)
    ] = "latest",
    output: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE|DIR",
            help="File to write; with --all, the folder.",
            show_default=False,
        ),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="All logs, except those that are already in the folder.")
    ] = False,
    overwrite: OverwriteOption = False,
) -> None:
    """Download a log, or all of them."""
    out = output_of(context, link)
    number = _number(log_id)
    if everything and log_id != "latest":
        raise CliError("give either a log or --all", USAGE)
    with connect_vehicle(context, link) as connection:
        logs = log_calls.fetch_list(connection)
        if not logs:
            raise CliError("the vehicle has no logs")
        files = log_calls.fetch_files(connection)
        if everything:
            _download_all(out, connection, logs, files, output, overwrite)
        else:
            log = _chosen(logs, number)
            file = log_calls.file_of(log, logs, files)
            path = _path(connection, log, file, output, False)
            _download(out, connection, log, logs, file, path, overwrite)


@app.command()
@expand_options
def erase(
    context: typer.Context,
    link: LinkOptions,
    yes: YesOption = False,
) -> None:
    """Erase all logs but the one that is being written.

    Asks first on a terminal; elsewhere it needs --yes. An armed vehicle may refuse.
    """
    if not yes and (sys.stdin is None or not sys.stdin.isatty()):
        raise CliError("erase removes all logs from the vehicle: confirm with --yes", USAGE)
    with connect_vehicle(context, link) as connection:
        before = log_calls.fetch_list(connection)
        if not before:
            raise CliError("the vehicle has no logs")
        size = size_text(sum(log.size for log in before))
        confirm(f"{len(before)} logs of {size} will be erased from the vehicle", yes, connection)
        left = log_calls.erase_logs(connection, len(before))
    left = log_calls.kept_logs(before, left)
    if len(left) == len(before) and len(before) > 1:
        raise CliError(f"the vehicle still has all {len(left)} logs")
    count = len(before) - len(left)
    sentence = f"{count} of {len(before)} logs erased"
    output_of(context, link).say(
        "erased", f"{sentence}, {len(left)} left" if left else sentence, erased=count, left=len(left)
    )


def _download_all(
    out: Output,
    connection: Connection,
    logs: tuple[LogEntry, ...],
    files: tuple[Entry, ...],
    output: Path | None,
    overwrite: bool,
) -> None:
    """Download the logs that are not in the folder yet; raise CliError if files of other sizes are in the way."""
    refused: list[str] = []
    for log in logs:
        file = log_calls.file_of(log, logs, files)
        path = _path(connection, log, file, output, True)
        if path.exists() and path.stat().st_size == log.size:
            out.say("exists", f"{path} exists already", path=str(path))
        elif path.is_file() and not overwrite:
            refused.append(str(path))  # a log that has grown since, or another file
        else:
            _download(out, connection, log, logs, file, path, overwrite)
    if refused:
        verb = "exists" if len(refused) == 1 else "exist"
        raise CliError(
            f"{', '.join(refused)}: {verb} already with another size: give another --out, or --overwrite",
            FAILED,
        )


def _download(
    out: Output,
    connection: Connection,
    log: LogEntry,
    logs: tuple[LogEntry, ...],
    file: Entry | None,
    path: Path,
    overwrite: bool,
) -> None:
    from gcs_cli.tui.widgets.transfer_bar import TransferBar

    check_new(path, overwrite)
    began_s = connection.now_s
    with TransferBar(f"log {log.log_id}") as bar:
        content = log_calls.fetch_log(connection, log, file, bar.show)
    took_s = max(1e-3, connection.now_s - began_s)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes_atomically(path, content)
    rate = size_text(len(content) / took_s)
    sentence = f"log {log.log_id}: {size_text(len(content))} written to {path} ({rate}/s)"
    is_growing = log_calls.is_growing(connection, log, logs)
    if is_growing:
        sentence += "; the vehicle is still writing this log: download it again after the flight"
    facts = {"id": log.log_id, "path": str(path), "size_bytes": len(content), "took_s": took_s}
    out.say("downloaded", sentence, **facts, is_growing=is_growing)


def _number(text: str) -> int | None:
    """Return the number of a log, or None for the latest; raise CliError (usage)."""
    if text == "latest":
        return None
    if not (text.isascii() and text.isdecimal() and len(text) <= 5):
        raise CliError(f"{text}: expected the number of a log, or latest", USAGE)
    return int(text)


def _chosen(logs: tuple[LogEntry, ...], number: int | None) -> LogEntry:
    if number is None:
        return logs[-1]
    for log in logs:
        if log.log_id == number:
            return log
    numbers = [log.log_id for log in logs]
    first, last = min(numbers), max(numbers)
    raise CliError(f"no log {number}: the vehicle has {first} to {last}", FAILED)


def _path(
    connection: Connection, log: LogEntry, file: Entry | None, output: Path | None, everything: bool
) -> Path:
    stamp = f"_{_moment(log):%Y%m%d-%H%M%S}" if log.time_utc_s else ""
    identity = connection.session.view.identity
    suffix = "" if identity is None else autopilot_of(identity.autopilot).log_suffix
    name = f"log_{log.log_id}{stamp}{suffix}" if file is None else file.name
    if output is None:
        return Path(name)
    return output / name if everything or output.is_dir() else output


def _facts(log: LogEntry, file: Entry | None) -> dict[str, object]:
    return {
        "id": log.log_id,
        "size_bytes": log.size,
        "time_utc": _moment(log).isoformat() if log.time_utc_s else None,
        "name": None if file is None else file.name,
    }


def _moment(log: LogEntry) -> datetime:
    return datetime.fromtimestamp(log.time_utc_s, UTC)


def _time_text(log: LogEntry) -> str:
    return f"{_moment(log):%Y-%m-%d %H:%M:%S}" if log.time_utc_s else "unknown time"


def size_text(size: float) -> str:
    """Format a number of bytes with three digits."""
    for unit in ("B", "kB", "MB"):
        if size < _KILO:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.3g} {unit}"
        size /= _KILO
    return f"{size:.3g} GB"
