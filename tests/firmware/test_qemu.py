"""The full image for a Cortex-M4 board on QEMU: vectors, start-up, interrupts, and the same application behind them."""

from __future__ import annotations

from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from flightstack.firmware.pil.steps import OVERRUN, REPEATED
from flightstack.firmware.sources import PORTABLE, c_files, firmware_root
from flightstack.firmware.toolchain.build import EXACT, includes
from flightstack.firmware.toolchain.cortex_m4 import emulated_target
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message
from tests.firmware.qemu_link import QemuLink, answered, heartbeat_line
from tests.firmware.step_machines import run, tool
from tests.firmware.step_streams import random_steps

PORT = firmware_root() / "ports" / "cortex_m4"
LIMIT_S = 600
"""After which QEMU counts as hung, as any test does. It takes some seconds."""
COUNTED = ["-icount", "shift=10,sleep=off"]


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
    """All of a report but its costs, whether they were too high, and whether the step was sent again."""
    stages = (
        report.attitude_target,
        report.reference,
        report.wrench,
        report.wrench_achieved,
        report.rotor_command,
    )
    return report.step, report.status & ~(OVERRUN | REPEATED), *map(tuple, stages)


def of_step(number: int, message: Message) -> Message | None:
    return message if message.get_type() == "FS_PIL_REPORT" and message.step == number else None


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


def test_it_lives_by_its_interrupts(image: Path) -> None:
    """SysTick brings the heartbeats, the UART's interrupts bring steps in and reports out."""
    steps = [frame for frame in random_steps(60, seed=1) if frame[7:9] == b"\x12\xcf"]
    command = qemu(image, "-serial", "stdio", "-semihosting-config", semihosting("uart"))
    target = emulated_target()
    with closing(QemuLink(command)) as link:
        line = heartbeat_line(link)
        first, second, *_ = (message for _, message in line.wait(2.0) if message.get_type() == "HEARTBEAT")
        for frame in steps:
            target.write(frame)
            (expected,) = reports(target.read(0.0))
            report = answered(partial(line.ask, frame, partial(of_step, expected.step)))
            assert made(report) == made(expected)
        status = answered(partial(line.request, "FS_PIL_STATUS"))
        while status.steps < len(steps):  # one that was due before
            status = answered(partial(line.request, "FS_PIL_STATUS"))
    assert (first.type, second.system_status) == (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_STATE_STANDBY)
    assert status.uart_overruns == 0
    assert 0 < status.stack_high_water < status.stack_size // 2
