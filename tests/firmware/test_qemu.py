"""The full image for a Cortex-M4 board on QEMU: vectors, start-up, interrupts, and the same application behind them."""

from __future__ import annotations

import os
import select
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from flightstack.firmware.sources import PORTABLE, c_files, firmware_root
from flightstack.firmware.toolchain.build import EXACT, includes
from flightstack.firmware.toolchain.cortex_m4 import emulated_target
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message
from tests.firmware.step_machines import run, tool
from tests.firmware.step_streams import random_steps

PORT = firmware_root() / "ports" / "cortex_m4"
LIMIT_S = 60
"""How long to wait for QEMU before it counts as hung: QEMU answers within milliseconds."""
COUNTED = ["-icount", "shift=10,sleep=off"]
OVERRUN = 0x40000


def qemu(image: Path, *more: str) -> list[str]:
    machine = [
        tool("qemu-system-arm", "qemu-system-arm"),
        "-M",
        "mps2-an386",
        "-nographic",
        "-monitor",
        "none",
    ]
    return [*machine, "-kernel", str(image), *more]


def semihosting(*words: str) -> str:
    return ",".join(["enable=on", "target=native", *(f"arg={word}" for word in words)])


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    tool("qemu-system-arm", "qemu-system-arm")
    compiler = tool("arm-none-eabi-gcc", "gcc-arm-none-eabi")
    made = tmp_path_factory.mktemp("mps2") / "mps2.elf"
    cpu = ["-mthumb", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-ffunction-sections"]
    link = ["-nostdlib", "-Wl,--gc-sections", f"-Wl,-T,{PORT / 'mps2.ld'}", "-Wl,-e,mps2_reset"]
    own = [*sorted(PORT.glob("mps2_*.c")), PORT / "semihosting.c", PORT / "support.c"]
    sources = [path for folder in PORTABLE for path in c_files(folder)]
    strict = ["-Wall", "-Wextra", "-Werror"]
    paths = includes(*PORTABLE, "ports/cortex_m4")
    run([compiler, *cpu, *link, *EXACT, *strict, *paths, *sources, *own, "-lgcc", "-o", made])
    return made


def through_files(image: Path, folder: Path, octets: bytes) -> bytes:
    """Let QEMU read a file to its end and return the file it wrote."""
    (folder / "in").write_bytes(octets)
    words = semihosting("files", str(folder / "in"), str(folder / "out"))
    run(
        [
            "timeout",
            "-s",
            "KILL",
            str(LIMIT_S),
            *qemu(image, *COUNTED, "-serial", "none", "-semihosting-config", words),
        ]
    )
    return (folder / "out").read_bytes()


def reports(octets: bytes) -> list[Message]:
    return [message for message in Link(255, 190).decode(octets) if message.get_type() == "FS_PIL_REPORT"]


def made(report: Message) -> tuple[object, ...]:
    """All of a report but its costs, and whether they were too high."""
    stages = (
        report.attitude_target,
        report.reference,
        report.wrench,
        report.wrench_achieved,
        report.rotor_command,
    )
    return report.step, report.status & ~OVERRUN, *map(tuple, stages)


def test_the_board_makes_what_the_emulated_processor_makes(image: Path, tmp_path: Path) -> None:
    steps, target = random_steps(2_000, seed=8, one_broken_in=0), emulated_target()
    here = []
    for frame in steps:
        target.write(frame)
        here += reports(target.read(0.0))
    there = reports(through_files(image, tmp_path, b"".join(steps)))
    assert len(there) == len(here) >= 1_000
    assert [made(report) for report in there] == [made(report) for report in here]


def test_its_instruction_counts_repeat_exactly(image: Path, tmp_path: Path) -> None:
    octets = b"".join(random_steps(500, seed=9, one_broken_in=0))
    first = through_files(image, tmp_path, octets)
    assert len(reports(first)) > 100
    assert through_files(image, tmp_path, octets) == first
    assert all(0 < report.cycles[3] < 10_000 for report in reports(first) if not report.status & 0xF0000)


class Board:
    """QEMU with its UART as standard input and output."""

    def __init__(self, image: Path) -> None:
        words = semihosting("uart")
        command = qemu(image, "-serial", "stdio", "-semihosting-config", words)
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
        self.link = Link(255, 190)
        self.came: Iterator[Message] = iter(())

    def send(self, octets: bytes) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(octets)

    def await_(self, kind: str) -> Message:
        """Return the next message of a kind, or fail when QEMU says nothing for too long."""
        assert self.process.stdout is not None
        while True:
            for message in self.came:
                if message.get_type() == kind:
                    return message
            ready, _, _ = select.select([self.process.stdout], [], [], LIMIT_S)
            assert ready, f"no {kind} within {LIMIT_S} s"
            octets = os.read(self.process.stdout.fileno(), 4096)
            assert octets, "QEMU has ended"
            self.came = iter(list(self.link.decode(octets)))


@pytest.fixture
def board(image: Path) -> Iterator[Board]:
    started = Board(image)
    yield started
    started.process.kill()  # SIGTERM may not end it
    started.process.wait()
    for pipe in (started.process.stdin, started.process.stdout):
        assert pipe is not None
        pipe.close()


def test_it_lives_by_its_interrupts(board: Board) -> None:
    """SysTick brings the heartbeats, the UART's interrupts bring steps in and reports out."""
    first, second = board.await_("HEARTBEAT"), board.await_("HEARTBEAT")
    assert (first.type, second.system_status) == (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_STATE_STANDBY)
    steps = [frame for frame in random_steps(60, seed=1) if frame[7:9] == b"\x12\xcf"]
    target = emulated_target()
    for frame in steps:
        target.write(frame)
        (expected,) = reports(target.read(0.0))
        board.send(frame)
        assert made(board.await_("FS_PIL_REPORT")) == made(expected)
    request = mavlink.MAVLink_command_long_message(
        1, 1, 512, 0, mavlink.MAVLINK_MSG_ID_FS_PIL_STATUS, *[0] * 6
    )
    board.send(board.link.encode(request))
    status = board.await_("FS_PIL_STATUS")
    while status.steps < len(steps):  # one that was due before
        status = board.await_("FS_PIL_STATUS")
    assert (status.bad_frames, status.skipped_octets, status.uart_overruns) == (0, 0, 0)
    assert 0 < status.stack_high_water < status.stack_size // 2
