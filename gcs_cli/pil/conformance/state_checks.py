"""Checks of what a target says about itself: identity, safe state, watchdog, stack, losses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from flightstack.core.contract import LoopFlags
from flightstack.firmware.c_loops import TARGET_AT
from flightstack.firmware.pil.steps import BAD_INPUT
from flightstack.mavlink.dialect import mavlink
from gcs_cli.pil.conformance.check import NOT_CHECKED, PASSED, Check, check_of
from gcs_cli.pil.conformance.line import Line
from gcs_cli.pil.conformance.loop_checks import step


def safe_state(line: Line, number: int) -> Check:
    """Send a step that is not a number: rotors stop, an emergency is reported, RESET alone ends it."""
    level = [0.0] * 6 + [1.0] + [0.0] * (TARGET_AT - 7)
    wrong = []
    bad = step(line, number, int(LoopFlags.RESET), [math.nan, *level[1:]])
    if bad is None or not bad.status & BAD_INPUT or any(bad.outputs):
        wrong.append("a step that is not a number does not stop the rotors")
    if not _beats(line, mavlink.MAV_STATE_EMERGENCY, 2.5):
        wrong.append("no heartbeat with MAV_STATE_EMERGENCY")
    refused = step(line, number + 1, 0, level)
    if refused is None or not refused.status & BAD_INPUT:
        wrong.append("a step without RESET is not refused")
    begun = step(line, number + 2, int(LoopFlags.RESET | LoopFlags.OUTER_DUE), level)
    if begun is None or begun.status & BAD_INPUT or not any(begun.outputs):
        wrong.append("RESET does not end the safe state")
    if not _beats(line, mavlink.MAV_STATE_STANDBY, 3.5):
        wrong.append("no heartbeat with MAV_STATE_STANDBY 1 s after the last step")
    return check_of(
        "safe state",
        not wrong,
        "; ".join(wrong) or "bad input stops the rotors until RESET; silence ends in standby",
        "The application does this by itself: check that NaN survives the compiler (no -ffast-math), and that "
        "fs_app_poll gets the milliseconds.",
    )


def _beats(line: Line, state: int, within_s: float) -> bool:
    return any(
        message.get_type() == "HEARTBEAT" and message.system_status == state
        for _, message in line.hear(within_s)
    )


def stack(status: Mapping[str, int]) -> Check:
    """Check that the stack is measured and that a quarter of it was never used."""
    size, used = status["stack_size"], status["stack_high_water"]
    if not size:
        return Check(
            "stack",
            NOT_CHECKED,
            "the target measures no stack",
            "Paint the stack at the start: see ports/gnu.",
        )
    return check_of(
        "stack",
        0 < used <= 0.75 * size,
        f"{used} of {size} used at most, in the target's smallest unit",
        "Below a quarter in reserve: enlarge the stack. If nothing or all seems to be used, it is not painted, or "
        "painted from the wrong end.",
    )


def watchdog(state_words: str, is_restarted: bool) -> Check:
    """Report whether the target had been restarted by its watchdog; over the line nothing else can be seen of it."""
    if is_restarted:
        return Check("watchdog", PASSED, "the target reported a restart by its watchdog")
    return Check(
        "watchdog", NOT_CHECKED, f"the target was {state_words}",
        "Build with -DFS_STOP_AFTER_MS=20000, wait 25 s after the start, and run this again.",
    )  # fmt: skip


def losses(before: Mapping[str, int], after: Mapping[str, int], own_frames: int) -> Check:
    """Check that the target lost nothing, and that the line does not echo."""
    counted = {
        name: (after[name] - before[name]) & 0xFFFF_FFFF
        for name in ("uart_overruns", "uart_errors", "dropped_frames")
    }
    words = [f"{name.replace('_', ' ')} {count}" for name, count in counted.items() if count]
    if own_frames:
        words.append(f"{own_frames} own frames came back")
    return check_of(
        "losses",
        not words,
        ", ".join(words) or "no overrun, no line error, no frame dropped, no echo",
        "Overruns: a larger ring or a faster interrupt. Line errors: the baud rate or the wiring. Dropped frames: the "
        "transmitter stops for too long. An echo: a console on the same UART, or TX and RX coupled.",
    )


def hello(identity: Any, expected_hash: bytes) -> Check:
    """Check what the target says about itself."""
    wrong = []
    if identity.real_octets != 4:
        wrong.append(f"loops of {8 * identity.real_octets} bits")
    if bytes(identity.source_hash) != expected_hash:
        wrong.append("other sources than these")
    if not identity.board.strip():
        wrong.append("no name of the board")
    if identity.char_bits not in (8, 16):
        wrong.append(f"char of {identity.char_bits} bits")
    return check_of(
        "hello",
        not wrong,
        ", ".join(wrong) or f"{identity.board.strip()}, {identity.compiler.strip()}",
        "Compile core, mavlink and app of this version without FS_DOUBLE, with -DFS_SOURCE_HASH of flightstack: "
        "firmware/README.md has the command for every board.",
    )
