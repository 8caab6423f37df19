"""A line that carries octets, whatever is at its other end."""

from __future__ import annotations

from typing import Protocol


class ByteLink(Protocol):
    """A stream of octets both ways, which may lose and change them."""

    name: str
    """What it is, for messages to the user."""

    def write(self, data: bytes) -> None:
        """Send octets; raise LineError when the line is gone."""

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, b"" when nothing does within ``timeout_s``; raise LineError when it is gone."""

    def close(self) -> None:
        """Close the line; a second call does nothing."""


class LineError(OSError):
    """A line cannot be opened, or is gone; the text is one sentence for the user."""
