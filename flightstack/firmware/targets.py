"""Create the loops of ``--loops``, and connect to their target."""

from __future__ import annotations

import subprocess
from pathlib import Path

from flightstack.control.backend import ControlBackend
from flightstack.control.loops import PythonLoops
from flightstack.core.errors import INSTALL_FIRMWARE, ConfigError, WrongFirmwareError
from flightstack.estimation.filter_core import FilterCore
from flightstack.firmware.c_loops import CLoops, HostLoops, LoopsSetup
from flightstack.firmware.choice import (
    DEFAULT_BAUD,
    EMULATED,
    FREE,
    PYTHON,
    SERIAL,
    SHORT,
    C,
    LoopsChoice,
    parse_loops,
)
from flightstack.firmware.law_tree import firmware_for
from flightstack.firmware.pil.client import DEFAULT_TIMING, PilTiming
from flightstack.firmware.pil.free_running import FreeLoops
from flightstack.firmware.pil.line_model import free_running_baud
from flightstack.firmware.pil.session import RatedLink, negotiate_baud
from flightstack.firmware.pil.target_filter import HostFilter, TargetFilter
from flightstack.firmware.pil.target_loops import TargetLoops
from flightstack.firmware.toolchain.build import BuildError, host_compiler, host_library, host_program
from flightstack.transports.byte_link import ByteLink, LineError
from flightstack.transports.serial_port import SerialPort

_EXIT_TIMEOUT_S = 5.0


class HostTarget:
    """Firmware as a process on a pseudo-terminal (``build.host_program``); implements ``ByteLink``."""

    name = "the host program"

    def __init__(self, program: Path) -> None:
        """Start the program; raise LineError. It exits when its stdin closes, at the latest with this process."""
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
        """Send bytes; raise LineError if the program has ended."""
        self._port.write(data)

    def read(self, timeout_s: float) -> bytes:
        """Return received bytes, b"" after ``timeout_s`` without any; raise LineError."""
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
            self._process.wait(_EXIT_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


EXCHANGE_BITS = 2800.0
"""Bits of the longest exchange, with start and stop bits."""


def make_loops(loops: str, setup: LoopsSetup, lockstep: bool = True) -> ControlBackend:
    """Return the loops of ``loops`` with all their numbers; raise ConfigError, TargetError."""
    choice = parse_loops(loops)
    _check_clock(choice, loops, lockstep)
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
        with firmware_for(setup.controller):
            if choice.kind == C:
                return CLoops(loops, HostLoops(host_library(), numbers), setup)
            return CLoops(loops, connect(choice, numbers), setup)
    except (BuildError, LineError, WrongFirmwareError) as error:
        raise ConfigError("--loops", loops, str(error).removeprefix(f"{choice.device}: ")) from error


def make_filter(loops: ControlBackend) -> FilterCore | None:
    """Return the filter that runs where the loops run; None for one in Python. Raise BuildError.

    A free-running target has no filter: its measurements would have to arrive at its own time.
    """
    executor = loops.executor if isinstance(loops, CLoops) else None
    if isinstance(executor, HostLoops):
        return HostFilter(executor.real)
    return TargetFilter(executor) if isinstance(executor, TargetLoops) else None


def check_loops(loops: str) -> None:
    """Raise ConfigError for loops that cannot run on this machine; neither compile them nor open a target."""
    choice = parse_loops(loops)
    _check_free(choice, loops)
    if choice.kind == SERIAL:
        if choice.device.startswith("/") and not Path(choice.device).exists():
            raise ConfigError("--loops", loops, "no such device")
        return
    try:
        check_tools(choice)
    except BuildError as error:
        raise ConfigError("--loops", loops, str(error)) from error


def _check_free(choice: LoopsChoice, loops: str) -> None:
    if choice.ending == FREE and choice.kind == EMULATED:
        raise ConfigError("--loops", loops, "cannot run by its own timer: an emulated target has none")


def _check_clock(choice: LoopsChoice, loops: str, lockstep: bool) -> None:
    _check_free(choice, loops)
    if choice.ending == FREE and lockstep:
        problem = f"a free-running target ({loops}) requires --clock realtime: it has its own time"
        raise ConfigError("--clock", "lockstep", problem)
    if choice.is_target and choice.ending != FREE and not lockstep:
        problem = f"loops on a target ({loops}) require lockstep: their link is not real-time"
        raise ConfigError("--clock", "realtime", problem)


def open_link(choice: LoopsChoice) -> ByteLink:
    """Open the link to a target, and start it if it is a program; raise BuildError, LineError."""
    if choice.kind == SERIAL:
        return SerialPort(choice.device, choice.baud)
    if choice.kind == EMULATED:
        return _emulated()
    return HostTarget(host_program())


def check_tools(choice: LoopsChoice) -> None:
    """Raise BuildError if a compiler or the emulator for this target is missing; nothing is compiled."""
    host_compiler()
    if choice.kind != EMULATED:
        return
    try:
        from flightstack.firmware.toolchain.cortex_m4 import cross_compiler
    except ImportError as error:
        raise BuildError(f"unicorn is not installed: {INSTALL_FIRMWARE}") from error
    cross_compiler()


def _emulated() -> ByteLink:
    try:
        from flightstack.firmware.toolchain.cortex_m4 import emulated_target
    except ImportError as error:
        raise BuildError(f"unicorn is not installed: {INSTALL_FIRMWARE}") from error
    return emulated_target()


def timing_of(choice: LoopsChoice) -> PilTiming:
    """Return the timeouts of a link."""
    if choice.kind != SERIAL:
        return DEFAULT_TIMING
    exchange_s = EXCHANGE_BITS / choice.baud
    return DEFAULT_TIMING._replace(timeout_s=DEFAULT_TIMING.timeout_s + 3.0 * exchange_s, step_s=exchange_s)


def connect(choice: LoopsChoice, numbers: dict[str, float]) -> TargetLoops | FreeLoops:
    """Return the loops on a target with their numbers; raise BuildError, LineError, TargetError, WrongFirmwareError."""
    link, timing, note = open_link(choice), timing_of(choice), None
    try:
        if isinstance(link, RatedLink):
            note = negotiate_baud(link, choice.baud, timing)
        if choice.kind == SERIAL and choice.ending == FREE:
            _check_rate(
                choice.device, choice.baud if note is None else DEFAULT_BAUD, numbers["FS_INNER_HZ"], note
            )
        loops = TargetLoops(link, numbers, timing, short=choice.ending == SHORT, note=note)
        return FreeLoops(loops) if choice.ending == FREE else loops
    except BaseException:
        link.close()
        raise


def _check_rate(name: str, baud: int, inner_hz: float, note: str | None) -> None:
    """Raise LineError for a line on which states of a free-running target would arrive ever later."""
    if (required := free_running_baud(inner_hz)) > baud:
        reason = "" if note is None else f" ({note})"
        raise LineError(
            f"{name}: free-running at {inner_hz:g} Hz requires at least {required:.0f} baud, "
            f"such as serial:DEVICE:921600,free{reason}"
        )


def finish_loops(loops: ControlBackend, log: Path | None) -> None:
    """Close the loops and write the record of a target's link beside ``log``; raise OSError."""
    loops.close()
    if log is not None and isinstance(loops, CLoops) and isinstance(loops.executor, TargetLoops | FreeLoops):
        loops.executor.write_record(log)
