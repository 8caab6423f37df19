"""Make the loops that fly from the word behind ``--loops``."""

from __future__ import annotations

import subprocess
from pathlib import Path

from flightstack.control.backend import ControlBackend
from flightstack.control.loops import PythonLoops
from flightstack.core.errors import INSTALL_FIRMWARE, ConfigError, WrongFirmwareError
from flightstack.firmware.build import BuildError, host_library, host_program
from flightstack.firmware.c_loops import CLoops, HostLoops, LoopsSetup
from flightstack.firmware.choice import DEFAULT_BAUD, EMULATED, PYTHON, SERIAL, C, LoopsChoice, parse_loops
from flightstack.firmware.pil_client import DEFAULT_TIMING, PilTiming
from flightstack.firmware.target_loops import TargetLoops
from flightstack.transports.byte_link import ByteLink, LineError
from flightstack.transports.serial_port import SerialPort

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
            self._port = SerialPort(device, DEFAULT_BAUD)
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


EXCHANGE_BITS = 8000.0
"""Bits of a step and its report twice over, in start and stop bits: what a slow line needs on top."""


def make_loops(loops: str, setup: LoopsSetup, lockstep: bool = True) -> ControlBackend:
    """Make the loops that ``loops`` names, with all their numbers; raise ConfigError, TargetError."""
    choice = parse_loops(loops)
    if choice.is_target and not lockstep:
        problem = f"loops on a target ({loops}) fly in lockstep alone: their link keeps no real time"
        raise ConfigError("--clock", "realtime", problem)
    if choice.kind == PYTHON:
        return PythonLoops(
            setup.vehicle,
            setup.controller,
            setup.gains,
            setup.inner_hz,
            setup.outer_hz,
            setup.max_tilt_rad,
        )
    numbers = setup.numbers()
    try:
        if choice.kind == C:
            return CLoops(loops, HostLoops(host_library(), numbers), setup)
        return CLoops(loops, connect(open_link(choice), numbers, timing_of(choice)), setup)
    except (BuildError, LineError, WrongFirmwareError) as error:
        raise ConfigError("--loops", loops, str(error).removeprefix(f"{choice.device}: ")) from error


def open_link(choice: LoopsChoice) -> ByteLink:
    """Open the line to a target, which is started if it is a program; raise BuildError, LineError."""
    if choice.kind == SERIAL:
        return SerialPort(choice.device, choice.baud)
    if choice.kind == EMULATED:
        return _emulated()
    return HostTarget(host_program())


def _emulated() -> ByteLink:
    try:
        from flightstack.firmware.cortex_m4 import emulated_target  # noqa: PLC0415  # unicorn is an extra
        from flightstack.firmware.emulator import EmulationError  # noqa: PLC0415
    except ImportError as error:
        raise BuildError(f"unicorn is not installed: {INSTALL_FIRMWARE}") from error
    try:
        return emulated_target()
    except EmulationError as error:
        raise BuildError(str(error)) from error


def timing_of(choice: LoopsChoice) -> PilTiming:
    """Return how long to wait for answers on the line."""
    if choice.kind != SERIAL:
        return DEFAULT_TIMING
    return DEFAULT_TIMING._replace(timeout_s=DEFAULT_TIMING.timeout_s + EXCHANGE_BITS / choice.baud)


def connect(link: ByteLink, numbers: dict[str, float], timing: PilTiming = DEFAULT_TIMING) -> TargetLoops:
    """Return the loops at the other end, with their numbers; closes the line when they cannot fly."""
    try:
        return TargetLoops(link, numbers, timing)
    except BaseException:
        link.close()
        raise


def finish_loops(loops: ControlBackend, log: Path | None) -> None:
    """End the loops; those of a target leave the record of their link beside ``log``. Raise OSError."""
    loops.close()
    if log is not None and isinstance(loops, CLoops) and isinstance(loops.executor, TargetLoops):
        loops.executor.write_record(log)
