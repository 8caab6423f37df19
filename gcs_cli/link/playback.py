"""A telemetry log as the transport of a vehicle that only sends."""

from __future__ import annotations

import select
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from flightstack.core.errors import ConfigError
from flightstack.transports.udp import Address
from gcs_cli.link.lines import Interest
from gcs_cli.link.tlog import Record, decode_records


class PlaybackClock:
    """Time of a recording that is read at once: it advances instead of waiting."""

    def __init__(self, now_s: float) -> None:
        self._now_s = now_s

    def now_s(self) -> float:
        """Return the time since the Unix epoch [s]."""
        return self._now_s

    def unix_s(self) -> float:
        """Return the time since the Unix epoch [s]."""
        return self._now_s

    def wait(self, poll: select.poll, wait_s: float) -> None:
        """Advance by ``wait_s``."""
        self._now_s += max(0.0, wait_s)


class PlaybackLine:
    """Yields the frames of a tlog at their time.

    ``real_now_s`` is the clock of a playback in real time; without one, the recording is read at once by ``clock``.
    """

    def __init__(self, path: str, real_now_s: Callable[[], float] | None = None) -> None:
        """Read the file; raise ConfigError."""
        self._peer: Address = (path, 0)
        self.peers: tuple[Address, ...] = ()
        self.problem = ""
        try:
            self._records = decode_records(Path(path).read_bytes())
        except OSError as error:
            raise ConfigError(path, "", f"cannot be read: {error.strerror}") from None
        self._next: Record | None = next(self._records, None)
        if self._next is None:
            raise ConfigError(path, "", "is no telemetry log (tlog) with MAVLink frames")
        first_s = self._next.time_us / 1e6
        self.clock = PlaybackClock(first_s)
        self._offset_s = 0.0 if real_now_s is None else real_now_s() - first_s

    @property
    def ended(self) -> bool:
        """True after the last frame."""
        return self._next is None

    def interests(self) -> Iterable[Interest]:
        """Return nothing: a file is always ready."""
        return ()

    def due_s(self) -> float | None:
        """Return the time of the next frame."""
        return None if self._next is None else self._next.time_us / 1e6 + self._offset_s

    def receive(self, now_s: float) -> Iterator[tuple[bytes, Address]]:
        """Yield the frames up to ``now_s``."""
        while self._next is not None and self._next.time_us / 1e6 + self._offset_s <= now_s:
            frame, self._next = self._next.frame, next(self._records, None)
            yield frame, self._peer

    def send(self, data: bytes, peer: Address) -> None:
        """Drop the frame: a recording takes no commands."""

    def closed_peers(self) -> Iterable[Address]:
        """Return nothing."""
        return ()

    def close(self) -> None:
        """Do nothing: the file is in memory."""
