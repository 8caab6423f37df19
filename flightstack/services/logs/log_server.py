"""Vehicle side of the log protocol (LOG_REQUEST_LIST, _DATA, _END, LOG_ERASE). No I/O.

As in PX4, ids count from 0, the oldest log first. A client downloads from the list that it received, so new logs do
not change its ids. Several clients may download at once; each ``poll`` sends a part.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.files import VirtualFile
from flightstack.mavlink.link import Address, Message, is_for, sender
from flightstack.mavlink.log_messages import BLOCK, log_data_message
from flightstack.services.logs.log_store import LogInfo, LogStore
from flightstack.services.rate_limit import RateLimit, always_has_room, rotated

CLIENT_TIMEOUT_S = 30.0
"""Timeout after which the list and the open log of a silent client are closed."""
MAX_CLIENTS = 64
MAX_RANGES = 64
SMALL_REQUEST = 10 * BLOCK
"""Requests up to this size fill gaps and are queued. A larger one replaces the queue, as every request in PX4."""

_MAX_UINT32 = 0xFFFF_FFFF
_NOTICE, _WARNING = int(mavlink.MAV_SEVERITY_NOTICE), int(mavlink.MAV_SEVERITY_WARNING)


@dataclass
class _Range:
    """Remaining bytes of a request."""

    log_id: int
    offset: int
    end: int


@dataclass
class _Client:
    """Requests of one client."""

    heard_s: float
    logs: Sequence[LogInfo] | None = None
    entries: deque[int] = field(default_factory=deque)
    ranges: deque[_Range] = field(default_factory=deque)
    opened: tuple[int, VirtualFile] | None = None

    @property
    def is_busy(self) -> bool:
        return bool(self.entries or self.ranges)

    def close(self) -> None:
        self.logs = None
        self.entries.clear()
        self.ranges.clear()
        if self.opened is not None:
            self.opened[1].close()
            self.opened = None


class LogServer:
    """Lists, sends and erases the logs of ``store``.

    An armed vehicle refuses to erase. ``say`` reports the result (MAV_SEVERITY, text), since LOG_ERASE has no
    acknowledgement.
    """

    handles = frozenset({"LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_REQUEST_END", "LOG_ERASE"})

    def __init__(
        self,
        own: Address,
        store: LogStore,
        is_armed: Callable[[], bool],
        say: Callable[[int, str], object],
        has_room: Callable[[Hashable], bool] = always_has_room,
        pace: RateLimit | None = None,
    ) -> None:
        """The requests of a peer wait while ``has_room`` is False for it, as in PX4."""
        self.own = own
        self._store = store
        self._is_armed = is_armed
        self._say = say
        self._has_room = has_room
        self._pace = pace or RateLimit()
        self._clients: dict[tuple[Hashable, Address], _Client] = {}
        self._turn = 0

    def backlog(self) -> list[int]:
        """Return the number of queued ranges of each client, at most MAX_RANGES."""
        return [len(client.ranges) for client in self._clients.values()]

    @property
    def is_busy(self) -> bool:
        """True while data is left to send to a peer with room."""
        return any(client.is_busy and self._has_room(peer) for (peer, _), client in self._clients.items())

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a message from ``peer``. Ignore other protocols and other targets."""
        kind = message.get_type()
        if kind not in self.handles or not is_for(message, self.own):
            return
        client = self._client((peer, sender(message)), now_s)
        if kind == "LOG_REQUEST_LIST":
            self._on_list(client, message.start, message.end)
        elif kind == "LOG_REQUEST_DATA":
            self._on_data(client, message.id, message.ofs, message.count)
        elif kind == "LOG_REQUEST_END":
            client.close()
        else:
            self._on_erase()

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the messages to send now, each with its peer; clients are served in turn."""
        if not self._clients:  # the usual case
            return []
        for (peer, _), client in self._clients.items():
            if client.is_busy and not self._has_room(peer):
                client.heard_s = now_s  # it waits for data
        self._forget_silent(now_s)
        sent: list[tuple[Hashable | None, Message]] = []
        allowance = self._pace.allowance(now_s)
        clients = self._clients.items()
        busy = [(key, client) for key, client in clients if client.is_busy and self._has_room(key[0])]
        busy = rotated(busy, self._turn)
        while busy and len(sent) < allowance:
            for key, client in busy[: allowance - len(sent)]:
                client.heard_s = now_s
                sent.append((key[0], self._next_message(client)))
            busy = [(key, client) for key, client in busy if client.is_busy]
        self._pace.take(len(sent))
        self._turn += len(sent)
        return sent

    def next_deadline(self) -> float | None:
        """Return the time of the next poll if no message arrives before; None for never."""
        clients = self._clients.values()
        if any(client.is_busy for client in clients):
            return self._pace.ready_s()
        return min((client.heard_s + CLIENT_TIMEOUT_S for client in clients), default=None)

    # -- clients

    def _client(self, key: tuple[Hashable, Address], now_s: float) -> _Client:
        client = self._clients.pop(key, None) or _Client(now_s)
        client.heard_s = now_s
        self._clients[key] = client
        if len(self._clients) > MAX_CLIENTS:
            self._clients.pop(next(iter(self._clients))).close()
        return client

    def _forget_silent(self, now_s: float) -> None:
        for key, client in list(self._clients.items()):
            if now_s - client.heard_s >= CLIENT_TIMEOUT_S:
                client.close()
                del self._clients[key]

    def _listed(self, client: _Client) -> Sequence[LogInfo]:
        if client.logs is None:
            client.logs = tuple(self._store.logs())
        return client.logs

    # -- requests

    def _on_list(self, client: _Client, start: int, end: int) -> None:
        """Queue the entries of a range, limited to valid ids as in PX4. Without logs the answer is one empty entry."""
        if start == 0:
            client.close()  # a new list; a range that starts later repeats lost entries
        last = max(0, len(self._listed(client)) - 1)
        client.entries = deque(range(min(start, last), min(end, last) + 1))

    def _on_data(self, client: _Client, log_id: int, offset: int, count: int) -> None:
        requested = _Range(log_id, offset, min(offset + count, _MAX_UINT32))
        client.entries.clear()
        if count > SMALL_REQUEST:
            client.ranges.clear()
        if requested not in client.ranges and len(client.ranges) < MAX_RANGES:
            client.ranges.append(requested)

    def _on_erase(self) -> None:
        if self._is_armed():
            self._say(_WARNING, "Logs not erased: the vehicle is armed")
            return
        for client in self._clients.values():
            client.close()
        try:
            count = self._store.erase()
        except OSError as error:
            self._say(_WARNING, f"Logs not erased: {error.strerror or error}")
        else:
            self._say(_NOTICE, f"{count} logs erased")

    # -- answers

    def _next_message(self, client: _Client) -> Message:
        if client.entries:
            return self._entry(client, client.entries.popleft())
        requested = client.ranges[0]
        data = self._read(client, requested)
        message = log_data_message(requested.log_id, requested.offset, data)
        requested.offset += len(data)
        # A short block marks the end of the log. If the size is a multiple of the block, an empty block follows, but
        # only for a request beyond the end.
        if len(data) < BLOCK or requested.offset >= requested.end:
            client.ranges.popleft()
        return message

    def _entry(self, client: _Client, log_id: int) -> Message:
        logs = self._listed(client)
        if not logs:
            return mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0)
        info = logs[log_id]
        size = min(info.size, _MAX_UINT32)
        return mavlink.MAVLink_log_entry_message(log_id, len(logs), len(logs) - 1, info.time_utc_s, size)

    def _read(self, client: _Client, requested: _Range) -> bytes:
        """Return the next bytes of a range; none at the end of the log, or if it cannot be read."""
        file = self._file(client, requested.log_id)
        with contextlib.suppress(OSError):
            if file is not None:
                return file.read(requested.offset, max(0, min(BLOCK, requested.end - requested.offset)))
        return b""

    def _file(self, client: _Client, log_id: int) -> VirtualFile | None:
        if client.opened is not None and client.opened[0] == log_id:
            return client.opened[1]
        if client.opened is not None:
            client.opened[1].close()
            client.opened = None
        logs = self._listed(client)
        file = None
        if log_id < len(logs):
            with contextlib.suppress(OSError):
                file = self._store.open(logs[log_id].name)
        if file is not None:
            client.opened = (log_id, file)
        return file
