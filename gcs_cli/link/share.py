"""One link for several ``gcs`` processes of a user: the first serves the others through a Unix socket.

A UDP port, a serial port or a TCP vehicle with room for one client can be opened once only. A ``gcs`` that runs long,
such as ``gcs watch``, forwards what it receives to the clients of its socket, and their frames to the vehicle, like
MAVProxy's ``--out``. The socket is in a folder that only its user can enter.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import select
import socket
import stat
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from flightstack.mavlink.frames import FrameReader
from flightstack.transports.udp import Address
from gcs_cli.errors import CliError
from gcs_cli.link.endpoint import SERIAL, VehicleEndpoint
from gcs_cli.link.lines import RETRY_S, Interest, Line, StreamLine
from gcs_cli.link.opening import open_line

_LONGEST_PATH = 100
"""Characters of a Unix socket's path that every system allows."""
_BACKLOG = 16
_SHARED: Address = ("shared link", 0)


def share_path(endpoint: VehicleEndpoint) -> Path:
    """Return the path of the socket that shares ``endpoint``."""
    host = os.path.realpath(endpoint.host) if endpoint.kind == SERIAL else endpoint.host
    words = (endpoint.kind, endpoint.port) if endpoint.listens else (endpoint.kind, host, endpoint.port)
    name = re.sub(r"[^A-Za-z0-9.]+", "-", "-".join(map(str, words)))
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    folder = Path(runtime) / "gcs" if runtime else Path(tempfile.gettempdir()) / f"gcs-{os.getuid()}"
    path = folder / f"{name}.sock"
    if len(str(path)) <= _LONGEST_PATH:
        return path
    return folder / f"{hashlib.sha256(name.encode()).hexdigest()[:16]}.sock"


def _is_private(folder: Path) -> bool:
    """Return True if only this user can enter the folder."""
    with contextlib.suppress(OSError):
        status = folder.stat(follow_symlinks=False)
        return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077
    return False


def _connected(path: Path) -> socket.socket | None:
    """Return a connection to the socket at ``path``; None if no process serves it."""
    if not _is_private(path.parent):
        return None
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    made.setblocking(False)
    try:
        made.connect(str(path))
    except OSError:
        made.close()
        return None
    return made


def is_served(endpoint: VehicleEndpoint) -> bool:
    """Return True if a process has the lock of those that serve ``endpoint``."""
    try:
        lock = os.open(share_path(endpoint).with_suffix(".lock"), os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(lock)
    return False


def _locked(path: Path) -> int | None:
    """Return the descriptor of the file at ``path``, locked until it is closed; None if that is not possible."""
    try:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        return None
    return lock


def open_shared(endpoint: VehicleEndpoint) -> Line | None:
    """Return the link of another ``gcs`` that uses ``endpoint``; None if there is none."""
    connected = _connected(share_path(endpoint))
    return None if connected is None else SharedLine(endpoint, connected)


class SharedLine:
    """A client of another process's link. When that process ends, it opens the endpoint itself, and serves the others.

    Several clients lose the link at once. The one that may serve opens the endpoint: a TCP link can be opened twice.
    """

    def __init__(self, endpoint: VehicleEndpoint, connected: socket.socket) -> None:
        self._endpoint = endpoint
        self._shared: StreamLine | None = StreamLine(socket.AF_UNIX, None, _SHARED, connected)
        self._line: Line = self._shared
        self._closed: list[Address] = []
        self._retry_s = 0.0
        self.server: ShareServer | None = None
        """Serves the others once it has opened the endpoint itself."""

    @property
    def peers(self) -> Sequence[Address]:
        """Addresses to send to before a vehicle is heard."""
        return self._line.peers

    @property
    def problem(self) -> str:
        """Reason that no data can be exchanged now."""
        return self._line.problem

    def interests(self) -> Iterable[Interest]:
        """Return the descriptors to wait for."""
        return self._line.interests()

    def due_s(self) -> float | None:
        """Return the time at which to call ``receive`` even if no descriptor is ready."""
        if self._shared is not None and not self._shared.is_connected:
            return self._retry_s
        return self._line.due_s()

    def receive(self, now_s: float) -> Iterable[tuple[bytes, Address]]:
        """Return the data that has arrived."""
        if self._shared is not None and not self._shared.is_connected:
            if now_s < self._retry_s:
                return ()
            self._retry_s = now_s + RETRY_S
            self._reopen()
        return self._line.receive(now_s)

    def _reopen(self) -> None:
        if self._shared is None:
            return
        connected = _connected(share_path(self._endpoint))
        if connected is not None:
            self._line = self._shared = StreamLine(socket.AF_UNIX, None, _SHARED, connected)
            return
        server = ShareServer.open(self._endpoint)
        if server is None and is_served(self._endpoint):  # another process begins to
            return
        try:
            self._line, self._shared = open_line(self._endpoint), None
        except CliError:
            if server is not None:
                server.close()
            return
        self.server = server  # None: nothing can be shared here
        self._closed.append(_SHARED)

    def send(self, data: bytes, peer: Address) -> None:
        """Send one frame."""
        self._line.send(data, peer)

    def closed_peers(self) -> Iterable[Address]:
        """Return the peers whose connections were closed."""
        closed, self._closed = self._closed, []
        return [*closed, *self._line.closed_peers()]

    def close(self) -> None:
        """Close the transport."""
        self._line.close()


class ShareServer:
    """Serves the link of ``endpoint`` to other processes of the same user."""

    def __init__(self, listener: socket.socket, path: Path, lock: int) -> None:
        """``lock`` is the descriptor of the locked file that lets one process only serve an endpoint."""
        self.listener = listener
        self._path, self._lock = path, lock
        self._clients: list[tuple[StreamLine, FrameReader]] = []

    @classmethod
    def open(cls, endpoint: VehicleEndpoint) -> ShareServer | None:
        """Listen; return None if another process serves this endpoint, or if no socket can be made."""
        path = share_path(endpoint)
        with contextlib.suppress(OSError):
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        lock = _locked(path.with_suffix(".lock")) if _is_private(path.parent) else None
        if lock is None:
            return None
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            path.unlink(missing_ok=True)  # of a process that was killed
            listener.setblocking(False)
            listener.bind(str(path))
            listener.listen(_BACKLOG)
        except OSError:
            listener.close()
            os.close(lock)
            return None
        return cls(listener, path, lock)

    @property
    def has_clients(self) -> bool:
        """True while other processes use the link."""
        return bool(self._clients)

    def interests(self) -> Iterable[Interest]:
        """Return the descriptors to wait for."""
        clients = [interest for line, _ in self._clients for interest in line.interests()]
        return [(self.listener.fileno(), select.POLLIN), *clients]

    def receive(self, now_s: float) -> Iterator[bytes]:
        """Yield the frames that clients send to the vehicle; accept clients."""
        for line, reader in self._clients:
            for data, _ in line.receive(now_s):
                yield from (frame.data for frame in reader.feed(data))
        self._clients = [client for client in self._clients if client[0].is_connected]
        with contextlib.suppress(OSError):
            while True:
                accepted = self.listener.accept()[0]
                accepted.setblocking(False)
                self._clients.append((StreamLine(socket.AF_UNIX, None, _SHARED, accepted), FrameReader()))

    def forward(self, data: bytes) -> None:
        """Send data of the vehicle to all clients."""
        for line, _ in self._clients:
            line.send(data, _SHARED)

    def close(self) -> None:
        """Remove the socket and close all connections; the clients look for the next server at once."""
        with contextlib.suppress(OSError):
            self._path.unlink()
        self.listener.close()
        os.close(self._lock)
        for line, _ in self._clients:
            line.close()
