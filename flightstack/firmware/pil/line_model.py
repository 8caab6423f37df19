"""Speed of the link to a target, from the octets of its steps and a model of its line. Pure.

An exchange takes the time of its octets on the line, ten bits each, and the delays of USB, of the target and of the
bridge: a USB bridge of FTDI holds received octets until its latency timer expires. Since a host sends the next step
when an answer arrives, exchanges take whole periods of that timer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from flightstack.core.contract import ATTITUDE_TARGET_SIZE, SETPOINT_SIZE, STATE_SIZE
from flightstack.firmware.pil.steps import REFERENCE_ATTITUDE_SIZE
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER_V2

BITS_PER_OCTET = 10.0
"""A start bit, eight data bits, a stop bit."""
TARGET_S = 1e-4
"""Time of a step on a target: 11 000 instructions (loops, codec, application) at 200 MHz take 0.06 ms."""
USB_S = 1.25e-4
"""Delay of high-speed USB per exchange: a microframe."""
_FRAME, _FLOAT = HEADER_V2 + CHECKSUM_SIZE, 4
_INNER_STATE, _STAGES = 7, 5 + 10 + 4 + 4
STATE_OCTETS = _FRAME + 8 + _FLOAT * (STATE_SIZE + SETPOINT_SIZE)
"""Octets of an FS_PIL_STATE."""


class Line(NamedTuple):
    """A serial line with a USB bridge."""

    baud: float
    timer_s: float = 0.0
    """Latency timer of the bridge; 0 for a bridge that forwards octets at once."""
    usb_s: float = USB_S
    target_s: float = TARGET_S


class Octets(NamedTuple):
    """Octets of one exchange, frames included."""

    sent: int
    received: int


def octets_of(rotors: int, short: bool, outer_due: bool, wants_reference: bool = False) -> Octets:
    """Return the octets of a step without given attitude target, and of its answer."""
    inner = _INNER_STATE if short else STATE_SIZE
    values = STATE_SIZE + SETPOINT_SIZE if outer_due else inner
    sent = _FRAME + 8 + _FLOAT * values
    if not short:
        return Octets(sent, _FRAME + 24 + _FLOAT * (_STAGES + rotors))
    extra = ATTITUDE_TARGET_SIZE * outer_due + REFERENCE_ATTITUDE_SIZE * wants_reference
    return Octets(sent, _FRAME + 12 + _FLOAT * (rotors + extra))


def period_octets(rotors: int, short: bool, divisor: int) -> list[Octets]:
    """Return the exchanges of an outer period of ``divisor`` inner ticks."""
    ticks = range(divisor)
    return [octets_of(rotors, short, tick == 0, short and tick == divisor - 1) for tick in ticks]


def exchange_s(line: Line, exchanges: Sequence[Octets]) -> float:
    """Return the time of steps that are sent together, from the first octet to the last answer [s].

    The line carries both directions at once: answers leave while later steps arrive.
    """
    octet_s = BITS_PER_OCTET / line.baud
    arrived_s = ended_s = 0.0
    for sent, received in exchanges:
        arrived_s += sent * octet_s
        ended_s = max(arrived_s + line.target_s, ended_s) + received * octet_s
    ended_s += line.usb_s
    return math.ceil(ended_s / line.timer_s) * line.timer_s if line.timer_s > 0.0 else ended_s


def lockstep_hz(line: Line, period: Sequence[Octets]) -> float:
    """Return the steps per second of a flight in lockstep, one exchange after another."""
    return len(period) / sum(exchange_s(line, [each]) for each in period)


def replay_hz(line: Line, period: Sequence[Octets], window: int) -> float:
    """Return the steps per second of a replay with windows of ``window`` steps."""
    steps = [period[at % len(period)] for at in range(window * len(period))]
    windows = [steps[at : at + window] for at in range(0, len(steps), window)]
    return len(steps) / sum(exchange_s(line, each) for each in windows)


def free_running_baud(rate_hz: float) -> float:
    """Return the baud rate that states of a free-running target require at ``rate_hz``; its commands are shorter."""
    return STATE_OCTETS * BITS_PER_OCTET * rate_hz


def spare_latency_s(line: Line, period: Sequence[Octets], rate_hz: float) -> float:
    """Return the mean latency per exchange beyond USB and target at which ``rate_hz`` is reached; negative: never."""
    at_once = line._replace(timer_s=0.0)
    return 1.0 / rate_hz - 1.0 / lockstep_hz(at_once, period)
