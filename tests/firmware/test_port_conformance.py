"""``gcs pil doctor --conformance`` on the main loop of ports/bare: a right port passes, each planted fault fails."""

from __future__ import annotations

import json
import platform
from pathlib import Path

import pytest

from gcs_cli.errors import DONE, NO_ANSWER, USAGE
from gcs_cli.pil.conformance.check import FAILED, NOT_CHECKED, PASSED, Check
from gcs_cli.pil.conformance.run import conformance
from gcs_cli.pil.conformance.time_checks import Sample, microseconds
from tests.firmware.bare_support import FAULTS, BareLink
from tests.firmware.static_support import FIRMWARE, INCLUDES, LANGUAGE, TARGETS, WARNINGS, ZIG, available, run
from tests.support.commands import gcs

TIMEOUT_S = 0.25
PORTS = FIRMWARE / "ports"
NAMES = [
    *(
        "hello",
        "watchdog",
        "byte values",
        "message sizes",
        "burst",
        "corrupted bytes",
        "cut frames",
        "time base",
    ),
    *("microseconds", "heartbeats", "parameter list", "parameter read-back", "loops", "subnormal numbers"),
    *("cost counter", "safe state", "stack", "losses"),
]


def checks(fault: str = "", *flags: str) -> dict[str, Check]:
    """Return the checks of a board in memory by their names."""
    link = BareLink(fault, flags)
    try:
        return {check.name: check for check in conformance(link, TIMEOUT_S, clock_s=None)}
    finally:
        link.close()


def failed(found: dict[str, Check]) -> set[str]:
    return {name for name, check in found.items() if check.result == FAILED}


def test_a_right_port_passes_every_check() -> None:
    found = checks()
    assert list(found) == NAMES
    assert {name: check for name, check in found.items() if check.result != PASSED}.keys() == {"watchdog"}
    assert found["watchdog"].result == NOT_CHECKED


PLANTED = {
    "SMALL_RING": {"message sizes", "burst", "loops", "losses"},
    "NO_TIME": {"cut frames", "time base", "heartbeats", "safe state"},
    "SLOW_TIME": {"time base", "heartbeats", "safe state"},
    "FAST_TIME": {"time base"},
    "TIME_RUNS_BACK": {"time base", "heartbeats"},
    "NO_CYCLES": {"cost counter"},
    "CYCLES_COUNT_DOWN": {"cost counter"},
    "SEVEN_BITS": {"hello"},
    "XON_XOFF": {"byte values"},
    "NEW_LINES": {"byte values", "parameter list"},
    "DROPS_SENT": {"parameter list"},
    "ECHO": {"losses"},
    "STACK_FULL": {"stack"},
    "NOISE": {"hello"},
    "US_STAND_STILL": {"microseconds"},
    "US_SLOW": {"microseconds"},
    "US_RUN_BACK": {"microseconds"},
    "US_WRAP_EARLY": {"microseconds"},
}


@pytest.mark.parametrize("fault", PLANTED)
def test_each_planted_fault_fails_with_advice(fault: str) -> None:
    found = checks(fault)
    assert failed(found) >= PLANTED[fault]
    assert all(check.advice for check in found.values() if check.result != PASSED)


def test_every_planted_fault_is_in_the_table() -> None:
    assert {*PLANTED, "WAS_WATCHDOG", "NO_US", "US_WRAP"} == set(FAULTS)


def test_a_restart_by_the_watchdog_is_recognised() -> None:
    assert checks("WAS_WATCHDOG")["watchdog"].result == PASSED


def test_microseconds_that_wrap_after_71_minutes_pass() -> None:
    found = checks("US_WRAP")
    assert not failed(found), found


def test_a_port_without_microseconds_is_not_checked_for_them() -> None:
    assert checks("NO_US")["microseconds"].result == NOT_CHECKED


@pytest.mark.parametrize(
    ("uptime_ms", "offset_us", "result"),
    [
        (3_600_000, 0, PASSED),
        (30_000, -(2**32 // 168), FAILED),  # a counter of 168 MHz, divided by 168, has wrapped once
        (3_600_000, -140 * (2**32 // 168), FAILED),
        (5_000_000, 0, PASSED),  # beyond the wrap
        (900_000_000, 123_456_789, PASSED),  # ten days: clocks within 2 % may be anywhere
    ],
)
def test_an_early_wrap_before_the_check_is_recognised(uptime_ms: int, offset_us: int, result: str) -> None:
    samples = [
        Sample(at_ms / 1e3, 0.001, uptime_ms + at_ms, (1000 * (uptime_ms + at_ms) + offset_us) % 2**32)
        for at_ms in range(0, 3200, 400)
    ]
    assert microseconds(samples).result == result


@pytest.mark.parametrize(
    ("flags", "names"),
    [
        (("-ffp-contract=fast", "-march=haswell"), {"loops"}),
        (("-freciprocal-math", "-fno-trapping-math"), {"loops", "subnormal numbers"}),
        (("-DBENCH_FLUSHES",), {"subnormal numbers"}),
        (("-DFS_DOUBLE",), {"hello", "loops", "subnormal numbers"}),
    ],
    ids=["contracted", "reciprocal", "flushed", "double"],
)
def test_other_arithmetic_fails(flags: tuple[str, ...], names: set[str]) -> None:
    if platform.machine() != "x86_64" and flags != ("-DFS_DOUBLE",):
        pytest.skip("the flags are of x86-64")
    assert failed(checks("", *flags)) == names


def test_doctor_prints_one_json_object_per_check() -> None:
    done = gcs("pil", "doctor", "--target", "emulated", "--conformance", "--json")
    assert done.returncode == DONE, done.stdout + done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["name"] for line in lines] == NAMES
    assert all(set(line) == {"event", "name", "result", "found", "advice"} for line in lines)
    assert {line["result"] for line in lines} == {PASSED, NOT_CHECKED}


def test_conformance_needs_one_port_and_one_rate() -> None:
    for words in ([], ["--port", "/dev/ttyNONE"], ["--target", "host", "--baud", "9600", "--baud", "19200"]):
        done = gcs("pil", "doctor", "--conformance", *words)
        assert done.returncode == USAGE, done.stdout + done.stderr


def test_a_silent_target_ends_with_no_answer(tmp_path: Path) -> None:
    link = BareLink("SEVEN_BITS")
    (check,) = conformance(link, TIMEOUT_S, clock_s=None)
    link.close()
    assert (check.name, check.result) == ("hello", FAILED)
    assert "8 data bits" in check.advice
    assert NO_ANSWER == 3


@pytest.mark.parametrize("name", TARGETS)
def test_template_and_main_loop_compile_without_a_warning(name: str, tmp_path: Path) -> None:
    target = available(TARGETS[name])
    sources = [*sorted((PORTS / "bare").glob("*.c")), *sorted((PORTS / "template").glob("*.c"))]
    only = ["-r", "-o", "all.o"] if target.command == ZIG else ["-c"]
    folders = [*INCLUDES, f"-I{PORTS / 'bare'}", '-DFS_BOARD="template"']
    done = run(
        [*target.command, *LANGUAGE, *WARNINGS, *target.flags, *folders, *only, *sources], cwd=tmp_path
    )
    assert (done.returncode, done.stderr) == (0, "")
