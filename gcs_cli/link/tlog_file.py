"""The telemetry log of a session as a file."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from flightstack.mavlink.link import Link, Message
from gcs_cli.link.tlog import Record, decode_records, encode_record


class TlogFile:
    """Writes a tlog, each record at once, so that a killed process leaves a readable file.

    A log that cannot be written must not end the session: the first error is kept in ``error``, and the file ends
    with the last whole record.
    """

    def __init__(self, path: Path) -> None:
        """Create or replace the file at ``path``; raise OSError when that fails."""
        self._file = path.open("wb", buffering=0)
        self._size = 0
        self.error: OSError | None = None

    def write(self, time_us: int, frame: bytes | memoryview) -> None:
        """Write one frame, received or sent at ``time_us`` since the Unix epoch."""
        if self.error is not None:
            return
        record = encode_record(time_us, frame)
        try:
            if self._file.write(record) < len(record):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self._size += len(record)
        except OSError as error:
            self.error = error
            with contextlib.suppress(OSError):  # a pipe cannot
                self._file.truncate(self._size)

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        self._file.close()

    def __enter__(self) -> TlogFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_messages(path: Path, message_ids: frozenset[int]) -> Iterator[tuple[Record, Message]]:
    """Yield the messages of a tlog with one of the given ids; the rest is not decoded."""
    link = Link(0, 0)
    for record in decode_records(path.read_bytes()):
        if record.message_id in message_ids:
            for message in link.decode(record.frame):
                yield record, message
