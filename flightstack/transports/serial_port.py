"""A serial port or pseudo-terminal as ``ByteLink``."""

from __future__ import annotations

import errno
import re
import select

import serial

from flightstack.transports.byte_link import LineError

_REASONS = {
    errno.ENOENT: "no such device",
    errno.EACCES: "permission denied: add your user to its group (dialout or uucp) and log in again",
    errno.EPERM: "permission denied: add your user to its group (dialout or uucp) and log in again",
    errno.EBUSY: "in use by another program",
    errno.EAGAIN: "in use by another program",
    errno.EWOULDBLOCK: "in use by another program",
    errno.ENXIO: "no such device",
    errno.ENOTTY: "is not a serial port",
    errno.EINVAL: "does not support these settings",
    errno.EISDIR: "is a directory",
}
_PIECE = 4096


class SerialPort:
    """An open serial port, 8N1 without flow control; opened exclusively; implements ``ByteLink``."""

    def __init__(self, device: str, baud: int) -> None:
        """Open ``device``; raise LineError."""
        self._device = device
        self.name = f"{device} at {baud} baud"
        try:
            self._port = serial.Serial(device, baud, timeout=0.0, write_timeout=5.0, exclusive=True)
            self._port.reset_input_buffer()
        except (serial.SerialException, OSError, ValueError, OverflowError) as error:
            raise LineError(f"{device}: {_reason(error)}") from error
        self._poll = select.poll()
        self._poll.register(self._port.fileno(), select.POLLIN)

    def set_baud(self, baud: int) -> None:
        """Change the baud rate and drop received bytes; raise LineError."""
        try:
            self._port.flush()
            self._port.baudrate = baud
            self._port.reset_input_buffer()
        except (serial.SerialException, OSError, ValueError, OverflowError) as error:
            raise LineError(f"{self._device}: cannot run at {baud} baud: {_reason(error)}") from error
        self.name = f"{self._device} at {baud} baud"

    def write(self, data: bytes) -> None:
        """Send bytes; raise LineError if the connection is lost."""
        try:
            self._port.write(data)
        except (serial.SerialException, OSError) as error:
            raise LineError(f"{self.name}: connection lost: {_reason(error)}") from error

    def read(self, timeout_s: float) -> bytes:
        """Return received bytes, b"" after ``timeout_s`` without any; raise LineError if the connection is lost."""
        try:
            if not self._poll.poll(max(0.0, timeout_s) * 1000.0):
                return b""
            data: bytes = self._port.read(_PIECE)
        except (serial.SerialException, OSError) as error:
            raise LineError(f"{self.name}: connection lost: {_reason(error)}") from error
        if not data:
            raise LineError(f"{self.name}: connection lost: closed by the other end")
        return data

    def fileno(self) -> int:
        """Return the file descriptor, for ``poll``."""
        return int(self._port.fileno())

    def close(self) -> None:
        """Close the port; a second call does nothing."""
        self._port.close()


def _reason(error: Exception) -> str:
    """Return the reason as text; while opening a port, pyserial has the errno in its message only."""
    number = getattr(error, "errno", None)
    if number is None and (found := re.search(r"\((\d+), ", str(error))):
        number = int(found[1])
    if number in _REASONS:
        return _REASONS[number]
    return str(error) or type(error).__name__
