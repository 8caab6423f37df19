"""Quiet exchanges with the flight stack in another process as one compiled call: commands in, state and sensors out.

It takes answers that are exactly the expected frame; all else waits in the inbox, as it came, for Python. A module of
its own, with few imports: the key of a kernel in the cache depends on all of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flightstack.core.arrays import copy_all
from flightstack.core.compiled import compiled
from flightstack.core.record_types import dtype_of
from flightstack.simulator_link.battery_kernels import write_battery
from flightstack.simulator_link.frame_kernels import (
    FIELDS_AT,
    HEADER,
    NUMBER_AT,
    VALUES_AT,
    frame_size,
    read_bytes,
    seal,
    seal_payload,
    write_bytes,
)
from flightstack.transports.compiled_socket import forget, receive_into, send_from
from sim_bridge.step_kernel import PAUSES, simulate


class Exchanges(NamedTuple):
    """What the kernel needs besides socket, frames and plant, and what it notes."""

    outbox_at: int
    """Address of the buffer of the messages."""
    state_size: int
    """Of the payload of the state."""
    state_extra: int
    """CRC_EXTRA of the state."""
    sensor_extra: int
    """CRC_EXTRA of HIL_SENSOR; then that of HIL_GPS."""
    gps_extra: int
    battery_extra: int
    """CRC_EXTRA of BATTERY_STATUS, and the number of the battery's cells."""
    cells: int
    valid_flag: int
    """Flag of each state; then that of one that touches the ground."""
    contact_flag: int
    lockstep_flag: int
    """Flags of the answers."""
    rotor_count: int
    interval_us: int
    imu_fields: int
    """Bits of HIL_SENSOR; the next two too."""
    mag_fields: int
    baro_fields: int
    largest_result: int
    """Of a step that the flight continues after."""
    steps: int
    """What was done: number of steps, result of the last one, and size of the last message."""
    result: int
    size: int


EXCHANGES = dtype_of(Exchanges)


@compiled
def _sensor_size(fields: int, number: int) -> int:
    """Return the size of the payload of HIL_SENSOR without trailing zeros; ``fields`` are not 0."""
    if number > 0:
        return NUMBER_AT + 1
    size = FIELDS_AT
    while fields > 0:
        fields >>= 8
        size += 1
    return size


@compiled
def _write_sensors(e: Any, at: int, outbox: Any, frames: Any, wires: Any, news: Any, time_us: int) -> int:
    """Write HIL_SENSOR of all inertial sensors to the outbox, the first one last; return where they end."""
    for k in range(len(wires) - 1, -1, -1):
        frame, fields = frames[k], e["imu_fields"]
        if k == 0:
            fields |= e["mag_fields"] if news["has_mag"] != 0 else 0
            fields |= e["baro_fields"] if news["has_baro"] != 0 else 0
        copy_all(wires[k], frame[HEADER + VALUES_AT :])
        write_bytes(frame, HEADER + FIELDS_AT, 4, fields)
        write_bytes(frame, HEADER + NUMBER_AT, 1, k)
        size = seal(frame, time_us, _sensor_size(fields, k), e["sensor_extra"])
        copy_all(frame[:size], outbox[at:])
        at += size
    return at


@compiled
def _write_payload(at: int, outbox: Any, frame: Any, payload: Any, extra: int) -> int:
    """Write a message to the outbox, without the zeros at the end of its payload; return where it ends."""
    size = len(payload)
    while size > 1 and payload[size - 1] == 0:
        size -= 1
    copy_all(payload, frame[HEADER:])
    size = seal_payload(frame, size, extra)
    copy_all(frame[:size], outbox[at:])
    return at + size


@compiled
def _write_battery(e: Any, outbox: Any, messages: Any, battery: Any) -> int:
    """Write BATTERY_STATUS to the outbox if this step noted the battery; return where it ends.

    ``messages`` are frame and payload, ``battery`` is what the kernel of the step notes.
    """
    _due_us, _period_us, _least_charge, rows, _times_us, count = battery
    if count[0] == 0:
        return 0
    count[0] = 0
    frame, payload = messages
    write_battery(payload, rows[0], e["cells"])
    return _write_payload(0, outbox, frame, payload, e["battery_extra"])


@compiled
def _write_state(e: Any, at: int, outbox: Any, state: Any, time_us: int) -> int:
    """Write FS_PLANT_STATE to the outbox; return where it ends."""
    flags_at = HEADER + e["state_size"] - 1
    state[flags_at] = e["valid_flag"] | (e["contact_flag"] if e["result"] != 0 else 0)
    size = seal(state, time_us, e["state_size"], e["state_extra"])
    copy_all(state[:size], outbox[at:])
    return at + size


@compiled
def _is_answer(line: Any, count: int, time_us: int, e: Any, shape: Any) -> bool:
    """Return True if the inbox has the answer to the state at ``time_us``, and nothing else."""
    inbox = line[2]
    if frame_size(inbox, 0, count, shape) != count or read_bytes(inbox, HEADER, 8) != time_us:
        return False
    flags_at = count - 3
    is_lockstep = inbox[flags_at] & e["lockstep_flag"] != 0
    return bool(is_lockstep and inbox[flags_at - 1] == e["rotor_count"])


@compiled
def serve_steps(
    line: Any, exchanges: Any, answer: Any, shape: Any, state: Any, sensors: Any, battery: Any, outbox: Any, world: Any,
    count: int, time_us: int,
) -> None:  # fmt: skip
    """Receive up to ``count`` answers, the first to the state at ``time_us``; make a step after each, and send it.

    ``answer`` and ``state`` are frames, ``sensors`` the frames of HIL_SENSOR and the bytes of the measurements, of
    which there are none without sensors, and the frame of HIL_GPS and its newest payload. ``battery`` is the frame of
    BATTERY_STATUS and a payload.
    """
    e, news = exchanges[0], world[4][0]
    frames, wires, gps_frame, gps = sensors
    e["steps"], e["result"], e["size"] = 0, 0, 0
    for _ in range(count):
        size = receive_into(line)
        if size != len(answer) or not _is_answer(line, size, time_us, e, shape):
            return
        for i in range(size):
            answer[i] = line[2][i]
        forget(line)
        time_us += e["interval_us"]
        e["result"] = simulate(world, time_us, int(answer[size - 3])) & ~PAUSES  # the message is sent
        e["steps"] += 1
        if e["result"] > e["largest_result"]:
            return
        end = _write_battery(e, outbox, battery, world[5])
        end = _write_state(e, end, outbox, state, time_us)
        if news["has_gnss"] != 0:
            end = _write_payload(end, outbox, gps_frame, gps, e["gps_extra"])
        end = _write_sensors(e, end, outbox, frames, wires, news, time_us)
        e["size"] = end
        if not send_from(line, e["outbox_at"], end):
            return
