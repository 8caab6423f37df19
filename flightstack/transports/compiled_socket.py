"""A connected socket and the clock for compiled code: system calls without Python between them.

Compiled code calls the C library at its addresses. It waits for ``RECEIVE_TIMEOUT_S`` of ``tcp``, and leaves to Python
what it cannot do: a message that is not accepted whole, a timeout, a signal, a closed connection.
"""

from __future__ import annotations

import ctypes
import select
import socket
import sys
import time
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.compiled import IS_DISABLED, compiled
from flightstack.core.contract import RecordArray
from flightstack.core.kernels.calls import call_c
from flightstack.core.record_types import dtype_of
from flightstack.transports.tcp import BUFFER_SIZE

IS_AVAILABLE = sys.platform == "linux" and sys.maxsize > 1 << 32 and not IS_DISABLED
"""True if the C library has the functions under the names and with the types of this module."""
_POLLIN = getattr(select, "POLLIN", 0)
_MONOTONIC = getattr(time, "CLOCK_MONOTONIC", 0)
_NS_PER_S = 1_000_000_000


class Socket(NamedTuple):
    """A socket, the addresses of functions and buffers, and what was done."""

    descriptor: int
    send: int
    receive: int
    poll: int
    clock: int
    poll_at: int
    time_at: int
    in_at: int
    sent: int
    """Bytes of the newest message that were sent; −1 without one."""
    received: int
    """Bytes that wait in the inbox; 0 if the peer closed the connection, −1 without any (timeout, signal, reset)."""


SOCKET = dtype_of(Socket)
_FLAGS = int(getattr(socket, "MSG_DONTWAIT", 0)) | int(getattr(socket, "MSG_NOSIGNAL", 0))


class CompiledSocket:
    """What compiled code needs of a connected socket, which must stay open. Python may use it between two calls."""

    def __init__(self, descriptor: int) -> None:
        library = ctypes.CDLL(None)
        functions = (
            ctypes.cast(function, ctypes.c_void_p).value
            for function in (library.send, library.recv, library.ppoll, library.clock_gettime)
        )
        self.inbox = np.zeros(BUFFER_SIZE, np.uint8)
        """Received bytes."""
        self._time = np.zeros(2, np.int64)
        self._polled = np.array([descriptor, _POLLIN], np.int32)  # pollfd of the C library
        buffers = (array.ctypes.data for array in (self._polled, self._time, self.inbox))
        self._record: RecordArray = np.array([(descriptor, *functions, *buffers, -1, -1)], SOCKET)
        self.arguments: tuple[Any, ...] = (self._record, self._time, self.inbox)
        """Argument ``line`` of the compiled functions."""

    @property
    def sent(self) -> int:
        """Bytes of the newest message that were sent; −1 without one."""
        return int(self._record["sent"][0])

    @property
    def received(self) -> memoryview | None:
        """Bytes that were received and not taken, empty if the peer closed the connection; None without any."""
        count = int(self._record["received"][0])
        return None if count < 0 else self.inbox[:count].data

    def clear(self) -> None:
        """Forget what was sent and received."""
        self._record["sent"], self._record["received"] = -1, -1


@compiled
def now_ns(line: Any) -> int:
    """Return the time of ``time.clock_gettime_ns(time.CLOCK_MONOTONIC)``."""
    record, time_array, _inbox = line
    call_c(record[0]["clock"], (_MONOTONIC, record[0]["time_at"]))
    return int(time_array[0] * _NS_PER_S + time_array[1])


@compiled
def forget(line: Any) -> None:
    """Count what was sent and received as taken."""
    line[0][0]["sent"], line[0][0]["received"] = -1, -1


@compiled
def send_from(line: Any, address: int, size: int) -> bool:
    """Send ``size`` bytes at ``address``; return False if not all were accepted."""
    record = line[0][0]
    sent = call_c(record["send"], (record["descriptor"], address, size, _FLAGS))
    record["sent"] = max(sent, 0)
    return bool(sent == size)


@compiled
def wait_for(line: Any, timeout_ns: int) -> bool:
    """Wait for bytes or the end of the connection; return False after ``timeout_ns`` or at a signal."""
    record, time_array, _inbox = line
    time_array[0], time_array[1] = timeout_ns // _NS_PER_S, timeout_ns % _NS_PER_S
    return bool(call_c(record[0]["poll"], (record[0]["poll_at"], 1, record[0]["time_at"], 0)) > 0)


@compiled
def receive_into(line: Any) -> int:
    """Wait for bytes in the inbox; return their number, 0 at the end of the connection, −1 for none."""
    record, _time, inbox = line
    count = call_c(record[0]["receive"], (record[0]["descriptor"], record[0]["in_at"], len(inbox), 0))
    record[0]["received"] = count
    return int(count)
