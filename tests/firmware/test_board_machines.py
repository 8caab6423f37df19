"""Images of boards on emulated chips: start code, clocks, UART, timers and watchdog by their registers."""

from __future__ import annotations

import ctypes
import itertools
import subprocess
from contextlib import closing
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from flightstack.firmware.c_loops import HostLoops
from flightstack.firmware.numbers import default_numbers
from flightstack.firmware.sources import firmware_root
from flightstack.firmware.toolchain.boards import GCC, ZIG
from flightstack.firmware.toolchain.build import host_library
from gcs_cli.pil.conformance.check import FAILED, PASSED
from gcs_cli.pil.conformance.line import Line
from gcs_cli.pil.conformance.link_checks import all_bytes, burst, cut_frame, sizes
from gcs_cli.pil.conformance.loop_checks import SMALL_VECTORS, expected_outputs, step, stepped, vectors
from gcs_cli.pil.conformance.run import conformance
from tests.firmware.board_builds import image
from tests.firmware.board_machines import BoardMachine, Nucleo, RegisterMisuseError
from tests.firmware.codec_support import compiler
from tests.firmware.pico2_machine import Pico2
from tests.firmware.qemu_link import QemuLink, answered, heartbeat_line
from tests.firmware.step_machines import tool
from tests.support.tools import NIGHTLY

TIMEOUT_S = 0.25
STARTED = 3_000_000
"""Cycles after which every image serves its main loop; an instruction takes some 20 of them."""
LATE_START = 20_000_000
"""The same after waiting for a clock in vain."""


def nucleo(name: str, compiler: str = ZIG, *flags: str, **chip: bool) -> Nucleo:
    machine = Nucleo(name, image(name, compiler, *flags), **chip)
    machine.run_to(STARTED)
    return machine


def pico2(name: str = "pico2", compiler: str = ZIG, *flags: str, **chip: bool) -> Pico2:
    machine = Pico2(image(name, compiler, *flags), **chip)
    machine.run_to(STARTED)
    return machine


def failed(machine: BoardMachine) -> list[str]:
    found = [check.name for check in conformance(machine, TIMEOUT_S, machine.now_s) if check.result == FAILED]
    machine.close()
    return found


def test_a_nucleo_f401_conforms() -> None:
    machine = nucleo("nucleo-f401re", GCC)
    assert machine.baud == pytest.approx(115_200, rel=0.002)  # 365 of 42 MHz: -0.11 %
    assert failed(machine) == []
    assert machine.watchdog_s == pytest.approx(0.125, rel=0.01)
    assert machine.services > 1000


@pytest.mark.parametrize("name", Nucleo.MAX_HZ)
def test_a_nucleo_built_by_zig_exchanges_bytes_and_bursts(name: str) -> None:
    machine = nucleo(name)
    assert machine.clock_hz == Nucleo.MAX_HZ[name][0]
    assert machine.baud == pytest.approx(115_200, rel=0.002)
    line = Line(machine, TIMEOUT_S, machine.now_s)
    assert [check(line).result for check in (all_bytes, burst, cut_frame)] == [PASSED] * 3
    machine.close()


def test_a_pico2_exchanges_bytes_bursts_and_cut_frames() -> None:
    """NIGHTLY=1 runs all conformance checks, 17 s of its time."""
    machine = pico2("pico2", GCC)
    assert machine.clock_hz == 150e6
    assert machine.baud == pytest.approx(115_200, rel=0.0002)
    if NIGHTLY:
        assert failed(machine) == []
        return
    line = Line(machine, TIMEOUT_S, machine.now_s)
    assert [check(line).result for check in (all_bytes, sizes, burst, cut_frame)] == [PASSED] * 4
    assert line.heartbeats >= 1
    assert machine.services > 500
    machine.close()


@pytest.mark.parametrize(
    ("name", "board"), [("pico2", "Pico 2, Cortex-M33")] + NIGHTLY * [("pico2-riscv", "Pico 2, Hazard3")]
)
def test_a_pico2_built_by_zig_has_the_bits_of_the_host(name: str, board: str) -> None:
    """The floating-point arithmetic of Hazard3 is zig's run-time library, but for division."""
    machine, steps = pico2(name), [*vectors(20), *vectors(SMALL_VECTORS, small=True)]
    line = Line(machine, 1.0, machine.now_s)
    identity = line.request("FS_PIL_IDENTITY")
    assert identity.board == board
    reports = stepped(line, steps)
    machine.close()
    expected = expected_outputs(HostLoops(host_library(), default_numbers()), steps)
    assert [list(report.outputs) for report in reports] == expected[:, :-1].tolist()
    assert [report.status & 0xFFFF for report in reports] == expected[:, -1].tolist()


def test_hazard3_divides_with_the_bits_of_ieee_754(tmp_path: Path) -> None:
    """Quotients around the largest and the smallest numbers, and of zeros, infinities and NaN."""
    path = tmp_path / "divide.so"
    source = firmware_root() / "ports" / "pico2" / "pico2_divide.c"
    subprocess.run([*compiler(), "-shared", "-fPIC", "-O2", str(source), "-o", str(path)], check=True)
    divide = ctypes.CDLL(str(path))["__divsf3"]
    divide.argtypes, divide.restype = [ctypes.c_float, ctypes.c_float], ctypes.c_float
    rng = np.random.default_rng(14)
    count = 20_000
    exponents = rng.integers(0, 255, count)
    others = np.clip(exponents + 127 - rng.choice([*range(-27, 4), *range(250, 257)], count), 0, 254)
    words = [rng.integers(0, 2**32, count) & 0x807F_FFFF | e << 23 for e in (exponents, others)]
    edges = np.array([0, 1, 2, 0x7F_FFFF, 0x80_0000, 0x3F80_0000, 0x7F7F_FFFF, 0x7F80_0000, 0x7FC0_0000])
    pairs = np.array(
        [*zip(*words, strict=True), *((a | s, b) for a in edges for b in edges for s in (0, 2**31))]
    )
    left, right = (pairs[:, place].astype(np.uint32).view(np.float32) for place in (0, 1))
    with np.errstate(all="ignore"):
        expected = left / right
    found = np.array([divide(*pair) for pair in zip(left.tolist(), right.tolist(), strict=True)], np.float32)
    is_number = ~np.isnan(expected)
    assert np.isnan(found[~is_number]).all()
    assert np.array_equal(found[is_number].view(np.uint32), expected[is_number].view(np.uint32))


def test_a_nucleos_image_runs_in_qemu_by_its_interrupts() -> None:
    """Vectors, SysTick and USART2 by QEMU's interrupt controller, in an STM32F405 with them at the same addresses.

    RCC, DWT and IWDG are missing: 16 MHz. An instruction takes 1 ns of QEMU's time.
    """
    machine = [
        tool("qemu-system-arm", "qemu-system-arm"),
        "-M",
        "netduinoplus2",
        "-icount",
        "shift=0,sleep=off",
    ]
    serial = ["-nographic", "-monitor", "none", "-serial", "null", "-serial", "stdio"]
    steps = vectors(30)
    with closing(QemuLink([*machine, *serial, "-kernel", str(image("nucleo-f401re", GCC))])) as link:
        line = heartbeat_line(link)
        line.wait(1.0)  # the first heartbeat
        identity = answered(lambda: line.request("FS_PIL_IDENTITY"))
        reports = [
            answered(partial(step, line, number, flags, numbers.tolist()))
            for number, (flags, numbers) in enumerate(steps)
        ]
    assert (identity.board, identity.clock_hz) == ("NUCLEO-F401RE", 16_000_000)
    expected = expected_outputs(HostLoops(host_library(), default_numbers()), steps)
    assert [list(report.outputs) for report in reports] == expected[:, :-1].tolist()


@pytest.mark.parametrize("name", Nucleo.MAX_HZ)
def test_a_nucleo_without_the_st_links_clock_runs_from_its_own(name: str) -> None:
    machine = nucleo(name, crystal=False)
    machine.run_to(LATE_START)
    assert machine.clock_hz == Nucleo.MAX_HZ[name][0]
    identity = Line(machine, TIMEOUT_S, machine.now_s).request("FS_PIL_IDENTITY")
    assert identity.clock_hz == machine.clock_hz
    machine.close()


def test_a_nucleo_without_pll_answers_at_16_mhz() -> None:
    machine = nucleo("nucleo-f446re", pll=False)
    machine.run_to(LATE_START)
    assert machine.baud == pytest.approx(115_200, rel=0.002)
    assert Line(machine, TIMEOUT_S, machine.now_s).request("FS_PIL_IDENTITY").clock_hz == 16_000_000
    machine.close()


@pytest.mark.parametrize("name", ["nucleo-f401re", "pico2"])
def test_a_restart_by_the_watchdog_is_told(name: str) -> None:
    machine = nucleo(name, watchdog=True) if name.startswith("nucleo") else pico2(name, watchdog=True)
    checks = conformance(machine, TIMEOUT_S, machine.now_s)
    assert [next(checks).result for _ in range(2)] == [PASSED, PASSED]
    machine.close()


@pytest.mark.parametrize("name", ["nucleo-f401re", "pico2"])
def test_a_stopped_main_loop_leaves_the_watchdog(name: str) -> None:
    flag = "-DFS_STOP_AFTER_MS=100"
    machine = nucleo(name, ZIG, flag) if name.startswith("nucleo") else pico2(name, ZIG, flag)
    machine.run_to(round(0.11 * machine.clock_hz))
    services = machine.services
    assert 60 <= services <= 100
    machine.run_to(round(0.15 * machine.clock_hz))
    assert machine.services == services
    machine.close()


def test_the_light_beats_each_512_ms() -> None:
    machine = nucleo("nucleo-f401re")
    machine.run_to(round(1.1 * machine.clock_hz))
    lit = [value == 1 << 5 for value in machine.light]
    assert sum(before != after for before, after in itertools.pairwise(lit)) == 2
    machine.close()


def test_every_byte_of_a_burst_reaches_a_nucleo_at_921600_baud() -> None:
    """One byte fits into its receiver, so that each takes an interrupt: 11 us apart."""
    machine = Nucleo(
        "nucleo-f401re", image("nucleo-f401re", ZIG, "-UNUCLEO_BAUD", "-DNUCLEO_BAUD=921600UL"), slowness=2
    )
    machine.run_to(STARTED)
    line = Line(machine, TIMEOUT_S, machine.now_s)
    line.send(b"".join(line.ping_frame(1 << 63 | n, n) for n in range(12)))
    echoed = [message.seq for _, message in line.wait(0.1) if message.get_type() == "PING"]
    assert echoed == list(range(12))
    machine.close()


def test_a_uart_that_is_used_too_early_is_seen() -> None:
    machine = Nucleo("nucleo-f401re", image("nucleo-f401re", ZIG))
    with pytest.raises(RegisterMisuseError, match="before it is on"):
        machine.read_register(0x4000_4400)
    machine.close()
