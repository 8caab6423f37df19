"""Protocol of a bidirectional byte stream."""

from __future__ import annotations

from typing import Protocol


class ByteLink(Protocol):
    """A bidirectional byte stream that may lose and corrupt bytes."""

    name: str
    """Name in messages to the user."""

    def write(self, data: bytes) -> None:
        """Send bytes; raise LineError if the connection is lost."""

    def read(self, timeout_s: float) -> bytes:
        """Return received bytes, b"" after ``timeout_s`` without any; raise LineError if the connection is lost."""

    def close(self) -> None:
        """Close the connection; a second call does nothing."""


class LineError(OSError):
    """A connection cannot be opened or is lost; the text is one sentence for the user."""
