"""The firmware as a process of this machine, behind a pseudo-terminal as behind a serial port."""

from __future__ import annotations

import subprocess
from pathlib import Path

from flightstack.transports.byte_link import LineError
from flightstack.transports.serial_port import SerialPort

_BAUD = 115_200
_PATIENCE_S = 5.0


class HostTarget:
    """Runs the program of ``build.host_program`` and is the line to it; implements ``ByteLink``."""

    name = "the host program"

    def __init__(self, program: Path) -> None:
        """Start it; raise LineError. It ends by itself when this process does: its input closes then."""
        try:
            self._process = subprocess.Popen(
                [str(program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
        except OSError as error:
            raise LineError(f"{program}: cannot be started: {error.strerror}") from error
        assert self._process.stdout is not None
        device = self._process.stdout.readline().decode(errors="replace").strip()
        try:
            self._port = SerialPort(device, _BAUD)
        except LineError:
            self._end()
            raise

    @property
    def pid(self) -> int:
        """Process id of the program."""
        return self._process.pid

    def write(self, data: bytes) -> None:
        """Send octets; raise LineError when the program is gone."""
        self._port.write(data)

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, b"" when nothing does within ``timeout_s``; raise LineError."""
        return self._port.read(timeout_s)

    def close(self) -> None:
        """End the program; a second call does nothing."""
        self._port.close()
        self._end()

    def _end(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
