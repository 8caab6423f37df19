"""The directory of a campaign: what is flown, and each row as soon as its flight is over.

``flights.jsonl`` is appended to, a line for each flight in a single write, which is synced: neither SIGKILL nor a power
failure loses a flight that is over. A last line without its end is removed at the next start. ``campaign.json`` has the
digests of all that the flights depend on.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from flightstack import __version__
from flightstack.core.atomic_file import naming, write_text_atomically
from flightstack.core.errors import ConfigError
from gcs_cli.campaign.installed import FLYING, sources_digest
from gcs_cli.campaign.plan import PlannedFlight
from gcs_cli.campaign.rows import Row
from gcs_cli.errors import USAGE, CliError

JOURNAL, RECORD = "flights.jsonl", "campaign.json"
RESULTS = PARQUET, CSV, REPORT = "flights.parquet", "flights.csv", "report.html"
_FORM = 2
"""Version of the directory's form."""
_DAMAGED = (ValueError, TypeError, AttributeError, KeyError)
"""What a damaged record raises."""


def record_of(
    kind: str, path: Path, files: Mapping[str, bytes], flights: Sequence[PlannedFlight]
) -> dict[str, Any]:
    """Return the record of the campaign in the file ``path``. ``kind``: ``plan`` or ``seek``.

    Records that are equal but for the name of that file fly equal flights.
    """
    inputs = json.dumps([[flight.number, flight.seed, dict(flight.inputs)] for flight in flights])
    return {
        "form": _FORM,
        "kind": kind,
        "campaign": path.name,
        "version": __version__,
        "sources": sources_digest(FLYING),
        "flights": hashlib.sha256(inputs.encode()).hexdigest(),
        "files": {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items())},
    }


class Journal:
    """The rows of a campaign, on disk. Only one process at a time has it open."""

    def __init__(self, folder: Path, record: Mapping[str, Any], overwrite: bool = False) -> None:
        """Open the journal in ``folder``, which exists; raise CliError if it belongs to another campaign, OSError.

        ``overwrite``: begin anew, whatever is there.
        """
        self._path = path = folder / JOURNAL
        is_new = not path.exists()
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
        try:
            self._lock(folder)
            if overwrite:
                self._clear(folder)
            self._open(folder, record, is_new)
        except BaseException:
            self.close()
            raise

    def _open(self, folder: Path, record: Mapping[str, Any], is_new: bool) -> None:
        try:
            _check_record(folder, record)
        except BaseException:
            if is_new and not os.fstat(self._descriptor).st_size:
                (folder / JOURNAL).unlink()
            raise
        self._record = record
        self.rows = self._read()
        """The row of each flight that is over, by its number."""

    def _lock(self, folder: Path) -> None:
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise CliError(
                f"{folder}: another gcs campaign writes to it: give another --out", USAGE
            ) from None

    def _clear(self, folder: Path) -> None:
        for name in (RECORD, *RESULTS):
            (folder / name).unlink(missing_ok=True)
        os.ftruncate(self._descriptor, 0)

    def _read(self) -> dict[int, Row]:
        """Return the whole rows, and cut off what follows them."""
        with os.fdopen(os.dup(self._descriptor), "rb") as file:
            file.seek(0)
            content = file.read()
        rows, end = _whole_rows(self._path, content)
        if end < len(content):
            os.ftruncate(self._descriptor, end)
        return rows

    def add(self, row: Row) -> None:
        """Append a row; raise OSError, which names the journal."""
        line = json.dumps(row, allow_nan=False).encode() + b"\n"
        with naming(self._path, self._path):
            if os.write(self._descriptor, line) < len(line):  # the next start removes the part
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self._descriptor)
        self.rows[int(row["flight"])] = row

    def count(self) -> int:
        """Return the number of rows on disk: Ctrl-C may come between the write of a row and its entry in ``rows``.

        If the file cannot be read any more, of which the next start says the reason, count the entries.
        """
        try:
            return len(self._read())
        except (CliError, OSError):
            return len(self.rows)

    def check_unchanged(self, record: Mapping[str, Any]) -> None:
        """Raise CliError if ``record``, made after the flights, differs from that before: they differ too."""
        difference = _difference(self._record, record)
        if difference:
            raise CliError(f"{difference} during the flights: --overwrite to fly all of them again", USAGE)

    def close(self) -> None:
        """Release the journal."""
        os.close(self._descriptor)


@contextlib.contextmanager
def open_journal(folder: Path, record: Mapping[str, Any], overwrite: bool = False) -> Iterator[Journal]:
    """Yield the journal of a campaign, as ``Journal`` opens it."""
    journal = Journal(folder, record, overwrite)
    try:
        yield journal
    finally:
        journal.close()


def flown_before(folder: Path, number: int) -> PlannedFlight:
    """Return a flight of the journal in ``folder``; raise CliError (usage) if it is not there."""
    try:
        rows, _ = _whole_rows(folder / JOURNAL, (folder / JOURNAL).read_bytes())
    except FileNotFoundError:
        raise CliError(f"{folder}: there is no search: --only repeats one of its flights", USAGE) from None
    if number not in rows:
        raise CliError(f"--only {number}: the search in {folder} has {len(rows)} flights", USAGE)
    return PlannedFlight(number, rows[number]["seed"], rows[number]["inputs"])


def check_search(folder: Path, record: Mapping[str, Any]) -> None:
    """Raise CliError (usage) if ``folder`` holds another campaign than the search with ``record``."""
    held = ""
    with contextlib.suppress(OSError, *_DAMAGED):  # no record, or a damaged one
        before = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        held = _held(before, record) if before["form"] == record["form"] else ""
    if held:
        raise CliError(f"{folder}: {held}: give the --out of the search", USAGE)


def changed_since(folder: Path, record: Mapping[str, Any]) -> str:
    """Return what changed since the flights of ``folder``, as the beginning of a sentence, or empty.

    ``record`` need not have the same flights.
    """
    with contextlib.suppress(OSError, *_DAMAGED):  # no record, or a damaged one
        before = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        return _difference(before, {**record, "flights": before["flights"]})
    return ""


def _whole_rows(path: Path, content: bytes) -> tuple[dict[int, Row], int]:
    """Return the rows up to the last line's end, and the number of their bytes; raise CliError for a damaged one."""
    end = content.rfind(b"\n") + 1
    rows: dict[int, Row] = {}
    for number, line in enumerate(content[:end].splitlines(), start=1):
        try:
            row = json.loads(line)
            rows[int(row["flight"])] = row
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
            remedy = "mend the line, or --overwrite to fly all again"
            raise CliError(f"{path}: line {number} is damaged: {remedy}", USAGE) from None
    return rows, end


def _check_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write the record, or raise CliError if the directory has another one."""
    path = folder / RECORD
    if not path.exists():
        if (folder / JOURNAL).stat().st_size:
            raise ConfigError(path, "", f"is missing beside {JOURNAL}: give another --out, or --overwrite")
        for name in RESULTS:  # of another command
            if (folder / name).exists():
                raise ConfigError(folder / name, "", "exists already: give another --out, or --overwrite")
        write_text_atomically(path, json.dumps(record, indent=2) + "\n")
        return
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
        held = _held(before, record)
        difference = _difference(before, record)
    except _DAMAGED:
        raise ConfigError(path, "", "is damaged: give another --out, or --overwrite") from None
    if held:
        raise CliError(f"{folder}: {held}: give another --out, or --overwrite to replace it", USAGE)
    if difference:
        remedy = "give another --out, or --overwrite to fly all of them again"
        raise CliError(f"{folder}: {difference} since its flights: {remedy}", USAGE)


def _held(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return which other campaign the record ``before`` is of, as the beginning of a sentence; empty for the same.

    A file of another name with the same content is the same campaign.
    """
    if before["form"] != now["form"]:
        return "the directory holds the campaign of another version of flightstack"
    own, name = before["campaign"], now["campaign"]
    if own != name and before["files"].get(own) != now["files"].get(name):
        return f"the directory holds the campaign of {own}"
    if before["kind"] != now["kind"]:
        kind = "a search with --seek" if before["kind"] == "seek" else "a campaign without --seek"
        return f"the directory holds {kind}"
    return ""


def _files(record: Mapping[str, Any], own: str) -> dict[str, str]:
    """Return the digests of the files by name, that of the campaign itself, which is named ``own``, by an empty one."""
    return {"" if name == own else name: digest for name, digest in record["files"].items()}


def _difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return what differs between two records, as the beginning of a sentence; empty if nothing does."""
    name = now["campaign"]
    then, files = (
        _files(before, before.get("campaign", name)),
        _files(now, name),
    )  # the first form had no name
    for file in sorted({*then, *files}):
        if then.get(file) != files.get(file):
            return f"{file or name} has changed"
    plan = "--flights" if now["kind"] == "seek" else "the plan of the flights"
    words = {
        "version": f"flightstack has changed from {before['version']} to {now['version']}",
        "sources": "the source code of flightstack has changed",
        "flights": f"{plan} has changed",
    }
    return next((text for name, text in words.items() if before[name] != now[name]), "")
