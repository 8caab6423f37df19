"""Compile the firmware's application for tests, and talk to it in the words of pymavlink."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import itertools
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.mavlink.dialect import mavlink
from tests.firmware.codec_support import ROOT, WARNINGS, compiler, filled_stack
from tests.firmware.kept_builds import alone

FIRMWARE = ROOT / "firmware"
PORTABLE = ("core", "mavlink", "app")
SENSING = ("core/estimation", "sensing")
LIBRARY = "FLIGHTSTACK_TEST_APP"
"""Environment variable: run the tests with this library, which somebody has compiled in another way."""
PROGRAM = "fs_host_program.c"

READY, STEPPING, SAFE, RESTARTED = range(4)
OUTER_DUE, SET_TARGET, RESET = 1, 2, 4
REPEATED, OUT_OF_ORDER, OVERRUN, BAD_INPUT = (1 << bit for bit in range(16, 20))
CYCLES, INSTRUCTIONS, NANOSECONDS = 1, 2, 3
LEVEL = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""A state: at the origin, at rest, level."""
ABOVE = (0.0, 0.0, -1.0, *(0.0,) * 8)
"""A setpoint: one metre above the origin."""
GCS = (255, 190)
Clock = ctypes.CFUNCTYPE(ctypes.c_uint32)
BaudCall = ctypes.CFUNCTYPE(ctypes.c_uint16, ctypes.c_uint32)
START_BAUD = 115_200
CLOCK_READINGS = 32
"""Of the application at its start, which measures their cost."""


UNWRITTEN = 0xA5
"""Each byte of an application's memory before its start: nothing is zero by chance."""
ALLOCATED_SIZE = getattr(ctypes.CDLL(None), "malloc_usable_size", None)
"""glibc's; without it the memory stays as it comes."""
if ALLOCATED_SIZE is not None:
    ALLOCATED_SIZE.restype = ctypes.c_size_t


def sources(*folders: str) -> list[Path]:
    """Return the C files of folders of the firmware."""
    return [path for folder in folders for path in sorted((FIRMWARE / folder).glob("*.c"))]


def host_sources() -> list[Path]:
    """Return what makes the application on the host, without the program's main."""
    own = [path for path in sources("ports/host") if path.name.startswith("fs_host") and path.name != PROGRAM]
    return [*sources(*PORTABLE, *SENSING), *own]


def words(*flags: str, program: bool = False) -> list[str]:
    """Return the arguments of a compiler for the library or the program, without the output."""
    folders = [f"-I{FIRMWARE / folder}" for folder in (*PORTABLE, *SENSING, "laws", "ports/host")]
    kind = [] if program else ["-shared", "-fPIC"]
    files = [*host_sources(), *([FIRMWARE / "ports/host" / PROGRAM] if program else [])]
    return [*WARNINGS, *flags, "-fno-math-errno", *kind, *folders, *map(str, files), "-lm"]


def build(output: Path, *flags: str, cc: Sequence[str] = (), program: bool = False) -> Path:
    """Compile library or program into ``output``; a failure shows the compiler's messages."""
    command = [*(cc or compiler()), *words(*flags, program=program), "-o", str(output)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=output.parent)
    assert done.returncode == 0, done.stderr
    return output


@functools.cache
def cached(name: str, *flags: str, program: bool = False) -> Path:
    """Return what ``build`` makes, compiled once for each state of the sources."""
    digest = hashlib.sha256(" ".join([*compiler(), *flags]).encode())
    headers = [
        path for folder in (*PORTABLE, *SENSING, "ports/host") for path in (FIRMWARE / folder).glob("*.h")
    ]
    for path in sorted([*host_sources(), *headers, FIRMWARE / "ports/host" / PROGRAM]):
        digest.update(path.read_bytes())
    folder = Path(tempfile.gettempdir()) / f"flightstack-app-{os.getuid()}" / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    with alone(path):
        if not path.exists():
            build(fresh := folder / f"{name}.{os.getpid()}", *flags, program=program)
            fresh.replace(path)
    return path


class Port(ctypes.Structure):
    """fs_port."""

    _fields_ = [
        ("clock", Clock),
        ("clock_hz", ctypes.c_uint32),
        ("cost_unit", ctypes.c_uint16),
        ("was_watchdog", ctypes.c_uint16),
        ("board", ctypes.c_char_p),
        ("compiler", ctypes.c_char_p),
        ("source_hash", ctypes.POINTER(ctypes.c_uint16)),
        ("stack_size", ctypes.c_uint32),
        ("stack_high_water", Clock),
        ("baud", ctypes.c_uint32),
        ("can_set_baud", BaudCall),
        ("set_baud", BaudCall),
        ("sense", ctypes.c_void_p),
        ("read_estimator", ctypes.c_void_p),
    ]


@functools.cache
def library(path: str = "", real: str = "float") -> ctypes.CDLL:
    """Load the application with float or double, or what the environment names instead."""
    flags = ["-O2", *filled_stack(), *(["-DFS_DOUBLE"] if real == "double" else [])]
    if not path and real == "float":
        path = os.environ.get(LIBRARY, "")
    loaded = ctypes.CDLL(path or str(cached(f"app-{real}.so", *flags)))
    loaded.fs_host_app_new.restype = loaded.fs_host_port.restype = ctypes.c_void_p
    for name in ("fs_host_app_transmit", "fs_app_wait_ms", "fs_app_run_wait_us"):
        getattr(loaded, name).restype = ctypes.c_uint32
    loaded.fs_app_state.restype = ctypes.c_uint16
    return loaded


class Target:
    """An application, its port, and the ground station's codec. ``now_ms`` is the port's time."""

    def __init__(
        self,
        *,
        ticks: Iterable[int] | None = (),
        cost_unit: int = CYCLES,
        clock_hz: int = 200_000_000,
        was_watchdog: bool = False,
        real: str = "float",
        own_port: bool = False,
        bauds: Sequence[int] = (),
        overhead: int = 0,
        has_estimator: bool = False,
    ) -> None:
        """``ticks``: what the clock shows at each call; without, it stands still; None: there is no clock.

        ``own_port``: the host's. ``bauds``: rates that the line can run at; without any, the port has no functions for
        rates. ``overhead``: cost
        of reading the clock that the application finds at its start, before ``ticks``.
        """
        self.baud = START_BAUD
        self.is_sending = False
        """True while the port still sends, so that its rate cannot change."""
        self._library = library(real=real)
        times = itertools.chain((overhead * at for at in range(CLOCK_READINGS)), ticks or ())
        self._hash = (ctypes.c_uint16 * 8)(*(0xFF00 + octet for octet in range(1, 9)))  # high bits: rubbish
        self._port = Port(
            Clock() if ticks is None else Clock(lambda: next(times, 0)), clock_hz, cost_unit, was_watchdog,
            b"test board with a name of many letters", b"compiler of " + b"many words " * 5, self._hash,
            4096, Clock(lambda: 321), START_BAUD,
            *((BaudCall(lambda baud: baud in bauds), BaudCall(self._set_baud)) if bauds else ()),
        )  # fmt: skip
        if has_estimator:
            self._port.sense = ctypes.cast(self._library.fs_sensing_take, ctypes.c_void_p)
            self._port.read_estimator = ctypes.cast(self._library.fs_sensing_read, ctypes.c_void_p)
        port = self._library.fs_host_port() if own_port else ctypes.addressof(self._port)
        self._app = ctypes.c_void_p(self._library.fs_host_app_new(None))
        if ALLOCATED_SIZE is not None:
            ctypes.memset(self._app, UNWRITTEN, ALLOCATED_SIZE(self._app))
        self._library.fs_app_init(self._app, ctypes.c_void_p(port))
        self.now_ms = 0
        self.codec = mavlink.MAVLink(None, *GCS)
        self.codec.robust_parsing = True
        self._rest = b""
        self._room = (ctypes.c_ubyte * 65536)()

    def _set_baud(self, baud: int) -> int:
        if self.is_sending:
            return 0
        self.baud = baud
        return 1

    def close(self) -> None:
        """Give the memory back."""
        self._library.fs_host_app_free(self._app)

    def give(self, data: bytes) -> None:
        """Let octets come from the line."""
        self._library.fs_host_app_receive(self._app, data, ctypes.c_uint32(len(data)))

    def give_element(self, element: int) -> None:
        """Let one element come as a C28x holds an octet: with anything in its high bits."""
        self._library.fs_app_receive(self._app, ctypes.c_uint16(element))

    def take(self, room: int = 65536) -> bytes:
        """Return at most ``room`` octets of what waits for the line."""
        count = self._library.fs_host_app_transmit(self._app, self._room, ctypes.c_uint32(room))
        return bytes(self._room[:count])

    def frames(self, room: int) -> list[bytes]:
        """Take at most ``room`` octets; return the frames that are whole with them."""
        self._rest += self.take(room)
        found = []
        while len(self._rest) > 1 and len(self._rest) >= (size := self._rest[1] + 12):
            found.append(self._rest[:size])
            self._rest = self._rest[size:]
        return found

    def poll(self, passed_ms: int = 0) -> None:
        """Let time pass, then the application do what is due."""
        self.now_ms = (self.now_ms + passed_ms) & 0xFFFF_FFFF
        self._library.fs_app_poll(self._app, ctypes.c_uint32(self.now_ms))

    def run(self, now_us: int) -> None:
        """Let the application run the tick that is due at this time."""
        self._library.fs_app_run(self._app, ctypes.c_uint32(now_us & 0xFFFF_FFFF))

    @property
    def run_wait_us(self) -> int:
        """In how many microseconds a tick is due."""
        return int(self._library.fs_app_run_wait_us(self._app))

    def uart_errors(self, overruns: int, errors: int) -> None:
        """Tell the totals of the serial port."""
        self._library.fs_app_uart_errors(self._app, ctypes.c_uint32(overruns), ctypes.c_uint32(errors))

    @property
    def state(self) -> int:
        """READY, STEPPING, SAFE or RESTARTED."""
        return int(self._library.fs_app_state(self._app))

    @property
    def wait_ms(self) -> int:
        """In how many milliseconds something is due."""
        return int(self._library.fs_app_wait_ms(self._app))

    def heard(self, data: bytes | None = None) -> list[Any]:
        """Return the messages in ``data``, or in what waits for the line; nothing in it is damaged."""
        found = self.codec.parse_buffer(self.take() if data is None else data) or []
        assert all(message.get_type() != "BAD_DATA" for message in found)
        return list(found)

    def pack(self, message: Any) -> bytes:
        """Return the ground station's frame around a message."""
        packed = bytes(message.pack(self.codec))
        self.codec.seq = (self.codec.seq + 1) % 256
        return packed

    def ask(self, *messages: Any) -> list[Any]:
        """Send messages; return what comes at once."""
        for message in messages:
            self.give(self.pack(message))
        return self.heard()

    def step(
        self, number: int, flags: int = 0, state: Sequence[float] = LEVEL, setpoint: Sequence[float] = ABOVE
    ) -> Any:
        """Send a step; return the first report that comes."""
        answers = self.ask(step(number, flags, state, setpoint))
        return next(answer for answer in answers if answer.get_type() == "FS_PIL_REPORT")

    def status(self) -> Any:
        """Ask for FS_PIL_STATUS and return it."""
        return self.request("FS_PIL_STATUS")

    def request(self, name: str) -> Any:
        """Ask for a message by MAV_CMD_REQUEST_MESSAGE and return it."""
        found = self.ask(command(512, getattr(mavlink, f"MAVLINK_MSG_ID_{name}")))
        return next(message for message in found if message.get_type() == name)

    def text_after(self, act: Callable[[], Any]) -> list[tuple[int, str]]:
        """Return severity and text of every STATUSTEXT that ``act`` causes in the next poll, or at once."""
        act()
        self.poll()
        texts = [message for message in self.heard() if message.get_type() == "STATUSTEXT"]
        return [(message.severity, message.text) for message in texts]


def step(
    number: int, flags: int = 0, state: Sequence[float] = LEVEL, setpoint: Sequence[float] = ABOVE
) -> Any:
    """Return an FS_PIL_STEP."""
    return mavlink.MAVLink_fs_pil_step_message(number, flags, list(state), [*setpoint, *[0.0] * 11][:11])


def tick(number: int, flags: int = 0, values: Sequence[float] = LEVEL[6:]) -> Any:
    """Return an FS_PIL_TICK; ``values`` as in the message, the rest zero."""
    return mavlink.MAVLink_fs_pil_tick_message(number, flags, [*values, *[0.0] * 24][:24])


def command(number: int, *values: float, system: int = 1, component: int = 1) -> Any:
    """Return a COMMAND_LONG."""
    parameters = [*values, *[0.0] * 7][:7]
    return mavlink.MAVLink_command_long_message(system, component, number, 0, *parameters)


def kinds(messages: Iterable[Any]) -> list[str]:
    """Return the names of messages."""
    return [message.get_type() for message in messages]


REAL32 = mavlink.MAV_PARAM_TYPE_REAL32


def read(name: str = "", index: int = -1, system: int = 1, component: int = 1) -> Any:
    """Return a PARAM_REQUEST_READ."""
    return mavlink.MAVLink_param_request_read_message(system, component, name.encode(), index)


def write(name: str, value: float, kind: int = REAL32, system: int = 1, component: int = 1) -> Any:
    """Return a PARAM_SET."""
    return mavlink.MAVLink_param_set_message(system, component, name.encode(), value, kind)


FIELDS = ("attitude_target", "reference", "wrench", "wrench_achieved", "rotor_command")


def numbers(report: object) -> list[float]:
    """Return what the loops computed, in the order of fs_loop_output."""
    return [value for name in FIELDS for value in getattr(report, name)]


def random_steps(count: int) -> list[tuple[int, list[float], list[float]]]:
    """Return flags, state and setpoint of a flight that changes between setpoints and targets."""
    rng = np.random.default_rng(5)
    made = []
    for index in range(count):
        attitude = np.array([1.0, 0.0, 0.0, 0.0]) + 0.2 * rng.standard_normal(4)
        state = [*rng.standard_normal(6), *(attitude / np.linalg.norm(attitude)), *rng.standard_normal(3)]
        flags = (0, OUTER_DUE, SET_TARGET, RESET | OUTER_DUE)[rng.choice(4, p=[0.75, 0.18, 0.05, 0.02])]
        setpoint = rng.standard_normal(11)
        if flags & SET_TARGET:
            setpoint = np.array([*(attitude / np.linalg.norm(attitude)), 5.0, *[0.0] * 6])
        flags |= RESET if index == 0 else 0
        made.append((flags, np.float32(state).tolist(), np.float32(setpoint).tolist()))
    return made


def state(
    time_us: int, flags: int = 0, values: Sequence[float] = LEVEL, setpoint: Sequence[float] = ABOVE
) -> Any:
    """Return a state for a target that runs freely."""
    return mavlink.MAVLink_fs_pil_state_message(time_us, flags, list(values), [*setpoint, *[0.0] * 11][:11])


def free_run(target: Target, *values: float) -> int:
    """Start or stop free running; return the result."""
    answers = target.ask(command(mavlink.MAV_CMD_FS_FREE_RUN, *values))
    return int(next(answer.result for answer in answers if answer.get_type() == "COMMAND_ACK"))
