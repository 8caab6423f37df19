"""An exchange with the simulator in another process as compiled code: commands out, state and sensors in.

It takes the place of the simulator's kernel in quiet ticks. It takes bytes that are exactly the frames of a quiet step;
all else waits in the inbox, as it came, for Python. A module of its own, with few imports: the key of a kernel in the
cache depends on all of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flightstack.core.arrays import copy_all
from flightstack.core.compiled import compiled
from flightstack.core.record_types import dtype_of
from flightstack.simulator_link.battery_kernels import has_more_charge
from flightstack.simulator_link.frame_kernels import (
    CHECKSUM,
    FIELDS_AT,
    HEADER,
    NUMBER_AT,
    VALUES_AT,
    frame_size,
    read_bytes,
    seal,
    write_bytes,
)
from flightstack.simulator_link.gps_kernels import GPS_NUMBER_AT
from flightstack.transports.compiled_socket import forget, now_ns, receive_into, send_from, wait_for

_FRAME = HEADER + CHECKSUM


class Exchange(NamedTuple):
    """What the kernel needs besides socket and frames, and what it notes."""

    answer_at: int
    """Address of the frame of the answer."""
    answer_size: int
    """Of the payload."""
    answer_extra: int
    """CRC_EXTRA of the answer."""
    interval_us: int
    imu_fields: int
    """Bits of HIL_SENSOR; the next two too."""
    mag_fields: int
    baro_fields: int
    takes_fixes: bool
    """True if the filters take HIL_GPS."""
    least_charge: float
    """Charge up to which a report of the battery is left to Python."""
    deadline_ns: int
    """Time of the monotonic clock from which no exchange begins that would be followed by an outer tick."""
    outer_us: int
    """Time of an outer tick by the simulator's clock, and the period of the outer loop."""
    period_us: int
    ended_ns: int
    """Time at which the newest state was there."""
    ends_in_pause: bool
    """True if Python goes on in a pause of the simulator."""
    pause_ns: int
    """Wait for a state above which the simulator pauses, and the sum of such waits."""
    waited_ns: int
    began: int
    """Number of exchanges that began."""


EXCHANGE = dtype_of(Exchange)


@compiled
def _news(inbox: Any, at: int, size: int, number: int, bits: Any) -> int:
    """Return the bits of HIL_SENSOR besides those of the inertial sensor; −1 if it is not that of ``number``.

    ``size`` is that of the frame. Groups of measurements are new as a whole.
    """
    payload, length = at + HEADER, size - _FRAME
    if length <= FIELDS_AT:
        return -1
    found = read_bytes(inbox, payload + NUMBER_AT, 1) if length > NUMBER_AT else 0
    fields = read_bytes(inbox, payload + FIELDS_AT, min(4, length - FIELDS_AT))
    mag, baro, imu = bits["mag_fields"], bits["baro_fields"], bits["imu_fields"]
    others = fields & ~imu
    if found != number or fields & imu != imu or others & ~(mag | baro) != 0 or (number > 0 and others != 0):
        return -1
    if others & mag not in (0, mag) or others & baro not in (0, baro):
        return -1
    return int(others)


@compiled
def _is_finite(inbox: Any, at: int, size: int) -> bool:
    """Return True if ``size`` bytes of single-precision numbers are finite."""
    for i in range(at, at + size, 4):  # noqa: SIM110  # compiled code has no generators
        if inbox[i + 3] & 0x7F == 0x7F and inbox[i + 2] & 0x80 != 0:  # all bits of the exponent
            return False
    return True


@compiled
def _gps_size(inbox: Any, at: int, end: int, bits: Any, shape: Any) -> int:
    """Return the size of the payload of HIL_GPS at ``at``: 0 without one, −1 for one that Python takes."""
    size = frame_size(inbox, at, end, shape) - _FRAME
    if size < 0:
        return 0
    is_other = size > GPS_NUMBER_AT and read_bytes(inbox, at + HEADER + GPS_NUMBER_AT, 1) != 0
    return -1 if is_other or not bits["takes_fixes"] else size


@compiled
def _battery_size(inbox: Any, end: int, e: Any, shape: Any, reports: Any) -> int:
    """Return the size of the frame of BATTERY_STATUS in front: 0 without one, −1 for one that Python takes."""
    size = frame_size(inbox, 0, end, shape)
    if size == 0:
        return 0
    rows, _times_us, count = reports
    is_taken = count[0] < len(rows) and has_more_charge(inbox[HEADER : size - CHECKSUM], e["least_charge"])
    return size if is_taken else -1


@compiled
def _note_battery(inbox: Any, size: int, time_us: int, reports: Any) -> None:
    """Keep the payload of a frame of ``size`` bytes in front, if there is one."""
    if size == 0:
        return
    rows, times_us, count = reports
    row = rows[count[0]]
    row[:] = 0  # the message lacks the zeros at its end
    copy_all(inbox[HEADER : size - CHECKSUM], row)
    times_us[count[0]] = time_us
    count[0] += 1


@compiled
def _take(inbox: Any, end: int, time_us: int, bits: Any, taking: Any) -> bool:
    """Take the frames of a quiet step at ``time_us``, ``end`` bytes; return False, and take nothing, for any other."""
    shapes, state, wires, values, news_array, gps, places, reports = taking
    begin = _battery_size(inbox, end, bits, shapes[3], reports)
    is_state = begin >= 0 and frame_size(inbox, begin, end, shapes[0]) == len(state)
    if not is_state or read_bytes(inbox, begin + HEADER, 8) != time_us:
        return False
    at = begin + len(state)
    others, gps_at = 0, at + HEADER
    gps_size = _gps_size(inbox, at, end, bits, shapes[2])
    if gps_size < 0:
        return False
    at += gps_size + _FRAME if gps_size > 0 else 0
    for k in range(len(wires) - 1, -1, -1):
        size = frame_size(inbox, at, end, shapes[1])
        others = -1 if size == 0 else _news(inbox, at, size, k, bits)
        if others < 0 or read_bytes(inbox, at + HEADER, 8) != time_us:
            return False
        places[k] = at + HEADER + VALUES_AT
        if not _is_finite(inbox, places[k], len(wires[k])):  # no measurement
            return False
        at += size
    if at != end:
        return False
    _note_battery(inbox, begin, time_us, reports)
    copy_all(inbox[begin : begin + len(state)], state)
    for k in range(len(wires)):
        copy_all(inbox[places[k] : places[k] + len(wires[k])], wires[k])
    if len(wires) > 0:
        copy_all(inbox[places[0] : places[0] + len(values)], values)
    news = news_array[0]
    news["has_mag"] = 1 if others & bits["mag_fields"] != 0 else 0
    news["has_baro"] = 1 if others & bits["baro_fields"] != 0 else 0
    news["has_gnss"] = 1 if gps_size > 0 else 0
    for i in range(len(gps) if gps_size > 0 else 0):  # the message lacks the zeros at its end
        gps[i] = inbox[gps_at + i] if i < gps_size else 0
    return True


@compiled
def exchange(world: Any, time_us: int, flags: int) -> int:
    """Send the commands in ``answer`` with ``flags``, and take the state at ``time_us``, the simulator's time.

    Return 0, or −1 if the deadline has come, or if Python is to go on with what was sent and received.
    """
    line, record, answer, took_ns, taking = world
    e = record[0]
    began_ns = now_ns(line)
    is_due = began_ns >= e["deadline_ns"] and (time_us - e["outer_us"]) % e["period_us"] == 0
    if is_due or e["began"] == len(took_ns):
        return -1
    took_ns[e["began"]] = began_ns - e["ended_ns"]
    e["began"] += 1
    write_bytes(answer, HEADER + e["answer_size"] - 1, 1, flags)
    size = seal(answer, time_us - e["interval_us"], e["answer_size"], e["answer_extra"])
    if not send_from(line, e["answer_at"], size):
        return -1
    is_silent = e["ends_in_pause"] and not wait_for(line, e["pause_ns"])
    count = -1 if is_silent else receive_into(line)
    e["ended_ns"] = now_ns(line)
    waited_ns = e["ended_ns"] - began_ns
    if waited_ns > e["pause_ns"]:
        e["waited_ns"] += waited_ns
    if not _take(line[2], count, time_us, e, taking):
        return -1
    forget(line)
    return 0
