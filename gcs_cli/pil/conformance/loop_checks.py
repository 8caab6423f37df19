"""Checks of the loops on a target: parameters and arithmetic."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence

import numpy as np

from flightstack.core.contract import ATTITUDE_TARGET_SIZE, SETPOINT_SIZE, STATE_SIZE, FloatArray, LoopFlags
from flightstack.core.float32 import as_float32
from flightstack.firmware.c_loops import SETPOINT_AT, TARGET_AT, HostLoops
from flightstack.firmware.pil.operations import TARGET_COMPONENT, TARGET_SYSTEM
from flightstack.firmware.pil.steps import PilReport
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from gcs_cli.pil.conformance.check import FAILED, NOT_CHECKED, Check, check_of
from gcs_cli.pil.conformance.line import Line
from gcs_cli.pil.conformance.link_checks import report_of
from gcs_cli.pil.ulps import steps_apart

SEED = 20
VECTORS, SMALL_VECTORS = 200, 40
SMALLEST_NORMAL = 2.0**-126
READ_BACK = "PID_ROLL_P"
PATTERNS = (0.1, 1.0 / 3.0, 1.0000001, 2.0**-20, 123456.789)
"""Values whose float32 has bits in every byte."""
_ULPS_OF_OTHER_FPU = 4096
"""Limit for a target whose arithmetic is not IEEE 754's, as the C28x: 5e-4 of a value, far below a wrong gain."""
_LIST_S = 3.0


def parameters(line: Line, expected: Mapping[str, float]) -> Check:
    """Restart the loops, list all parameters and compare them with the defaults."""
    line.send(line.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0))
    line.wait(0.0)
    listed: dict[str, float] = {}
    count = len(expected)
    line.send(line.pack(mavlink.MAVLink_param_request_list_message(TARGET_SYSTEM, TARGET_COMPONENT)))
    last_s = line.now_s
    while line.now_s - last_s < _LIST_S and len(listed) < count:
        for at_s, message in line.hear(line.timeout_s):
            if message.get_type() == "PARAM_VALUE":
                listed[message.param_id], count, last_s = message.param_value, message.param_count, at_s
            if len(listed) >= count:
                break
    missing = sorted(set(expected) - set(listed))
    wrong = sorted(name for name in set(expected) & set(listed) if listed[name] != as_float32(expected[name]))
    found = f"{len(listed)} of {len(expected)} parameters are listed"
    if missing:
        found += f"; missing: {', '.join(missing[:5])}{' …' if len(missing) > 5 else ''}"
    if wrong:
        found += f"; other defaults: {', '.join(wrong[:5])}{' …' if len(wrong) > 5 else ''}"
    return check_of(
        "parameter list",
        not missing and not wrong,
        found,
        "A list is 5 kB in one piece: missing parameters are bytes that the transmitter dropped. Other defaults are "
        "other sources, or a compiler that rounds constants differently.",
    )


def read_back(line: Line) -> Check:
    """Set a parameter to values with bits in every byte and read them back; set one that is refused."""
    name, wrong = READ_BACK, []
    for value in PATTERNS:
        set_value = as_float32(value)
        if not _set(line, name, set_value) or _read(line, name) != struct.pack("<f", set_value):
            wrong.append(f"{value:g}")
    kept = _read(line, name)
    line.send(line.pack(_param_set(name, math.nan)))
    is_refused = line.ask(line.pack(_param_set("NO_SUCH_NAME", 1.0)), _param_error) is not None
    if not is_refused or _read(line, name) != kept:
        wrong.append("a value or a name that must be refused")
    return check_of(
        "parameter read-back",
        not wrong,
        f"{len(PATTERNS)} values are read back with the same bits"
        if not wrong
        else f"not kept: {', '.join(wrong)}",
        "float must be IEEE 754's binary32: no -fshort-double, no other representation, and bytes in order.",
    )


def restore(line: Line, numbers: Mapping[str, float]) -> bool:
    """Set the parameter of ``read_back`` to its default; return False if it is not confirmed."""
    return _set(line, READ_BACK, as_float32(numbers[READ_BACK]))


def _param_set(name: str, value: float) -> Message:
    return mavlink.MAVLink_param_set_message(
        TARGET_SYSTEM, TARGET_COMPONENT, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
    )


def _param_error(message: Message) -> bool | None:
    return True if message.get_type() == "PARAM_ERROR" else None


def _set(line: Line, name: str, value: float) -> bool:
    def accept(message: Message) -> bool | None:
        is_it = message.get_type() == "PARAM_VALUE" and message.param_id == name
        return True if is_it and message.param_value == value else None

    return line.ask(line.pack(_param_set(name, value)), accept) is not None


def _read(line: Line, name: str) -> bytes | None:
    request = mavlink.MAVLink_param_request_read_message(TARGET_SYSTEM, TARGET_COMPONENT, name.encode(), -1)

    def accept(message: Message) -> bytes | None:
        is_it = message.get_type() == "PARAM_VALUE" and message.param_id == name
        return struct.pack("<f", message.param_value) if is_it else None

    return line.ask(line.pack(request), accept)


def vectors(count: int, small: bool = False) -> list[tuple[int, FloatArray]]:
    """Return the flags and the 24 numbers of random steps, the first with RESET.

    ``small`` steps have inputs so close to zero that products underflow to subnormal numbers.
    """
    rng = np.random.default_rng(SEED)
    found = []
    for index in range(count):
        numbers = np.zeros(TARGET_AT)
        numbers[:STATE_SIZE] = rng.normal(size=STATE_SIZE) * (2.0**-135 if small else 0.3)
        numbers[6] = 1.0
        numbers[6:10] /= np.linalg.norm(numbers[6:10])
        numbers[SETPOINT_AT:] = rng.normal(size=SETPOINT_SIZE) * (2.0**-135 if small else 0.5)
        flags = LoopFlags.RESET if index == 0 else 0
        if index % 25 == 7:
            flags |= LoopFlags.SET_TARGET
            numbers[SETPOINT_AT:] = 0.0
            numbers[SETPOINT_AT : SETPOINT_AT + ATTITUDE_TARGET_SIZE] = (1.0, 0.0, 0.0, 0.0, 9.0)
        elif index % 5 == 0:
            flags |= LoopFlags.OUTER_DUE
        found.append((int(flags), numbers.astype(np.float32).astype(np.float64)))
    return found


def stepped(line: Line, steps: Sequence[tuple[int, FloatArray]]) -> list[PilReport]:
    """Run steps on the target; return the reports up to the first step without an answer."""
    reports = []
    for number, (flags, numbers) in enumerate(steps):
        report = step(line, number, flags, numbers.tolist())
        if report is None:
            break
        reports.append(report)
    return reports


def step(line: Line, number: int, flags: int, numbers: Sequence[float]) -> PilReport | None:
    """Run one step; return its report, None without an answer."""
    message = mavlink.MAVLink_fs_pil_step_message(
        number, flags, list(numbers[:SETPOINT_AT]), list(numbers[SETPOINT_AT:])
    )
    return line.ask(line.pack(message), lambda heard: report_of(heard, number))


def expected_outputs(loops: HostLoops, steps: Sequence[tuple[int, FloatArray]]) -> FloatArray:
    """Return the outputs and the status of this machine's loops for the same steps, a row each."""
    rows = []
    for flags, numbers in steps:
        loops.input[:] = 0.0
        if flags & LoopFlags.SET_TARGET:
            loops.input[:SETPOINT_AT] = numbers[:SETPOINT_AT]
            loops.input[TARGET_AT:] = numbers[SETPOINT_AT : SETPOINT_AT + ATTITUDE_TARGET_SIZE]
        else:
            loops.input[:TARGET_AT] = numbers
        loops.step(flags)
        rows.append(loops.output.copy())
    return np.array(rows)


def arithmetic(line: Line, loops: HostLoops, char_bits: int) -> tuple[list[Check], list[PilReport]]:
    """Compare stepped vectors with this machine's loops: of a flight, and with subnormal numbers."""
    steps, tiny = vectors(VECTORS), vectors(SMALL_VECTORS, small=True)
    reports, small = stepped(line, steps), stepped(line, tiny)
    advice = (
        "Compile with -ffp-contract=off -fno-fast-math -fno-math-errno (cl2000: --fp_mode=strict --fp_reassoc=off), "
        "use float only, and correctly rounded division and square root."
    )
    flight = _compared("loops", reports, expected_outputs(loops, steps), char_bits, advice)
    advice = (
        "The processor flushes subnormal numbers to zero: switch that off (Cortex-M: clear FPSCR.FZ; x86: MXCSR). A "
        "flight in which nothing is that small has the same bits."
    )
    tests = [flight, _compared("subnormal numbers", small, expected_outputs(loops, tiny), char_bits, advice)]
    return tests, [*reports, *small]


def _compared(
    name: str, reports: Sequence[PilReport], expected: FloatArray, char_bits: int, advice: str
) -> Check:
    if len(reports) < len(expected):
        return Check(
            name,
            FAILED,
            f"no answer to step {len(reports)} of {len(expected)}",
            "See the checks of the line.",
        )
    outputs = np.array([report.outputs for report in reports], np.float32)
    apart = steps_apart(outputs, expected[:, :-1].astype(np.float32))
    status = [report.status & 0xFFFF for report in reports] != expected[:, -1].astype(int).tolist()
    rows, most = int(np.any(apart > 0, axis=1).sum()), int(apart.max())
    if char_bits == 8:
        found = f"{len(reports) - rows} of {len(reports)} steps have the bits of this machine's C"
        if rows:
            found += f", {most} ulp apart at most"
        return check_of(name, not rows and not status, found, advice)
    found = f"{most} ulp apart at most in {len(reports)} steps; this processor is compared within tolerances"
    if name == "loops":
        return check_of(name, most <= _ULPS_OF_OTHER_FPU and not status, found, advice)
    return Check(name, NOT_CHECKED, found, "The C28x flushes subnormal numbers.")
