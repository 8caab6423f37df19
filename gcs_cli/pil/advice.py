"""Advice on the link to a target, from its measurements. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from gcs_cli.pil.probe import Measurement
from gcs_cli.pil.target_record import RESTARTED, SAFE, state_words

FTDI_LATENCY_MS = 16.0
"""Default latency timer of an FTDI bridge, as in the XDS100v2."""
_SLACK_S = 0.004
"""Longest round trip beyond the time on the wire without a latency timer."""
_MUCH_LOSS = 0.01
_INNER_HZ = 500.0


class Port(NamedTuple):
    """A serial port of this machine."""

    device: str
    latency_ms: float | None = None
    """Latency timer of its bridge; None without one, or if unknown."""
    latency_path: str = ""
    """File that sets the latency timer."""


def advice(port: Port | None, found: Sequence[Measurement], expected_hash: str) -> list[str]:
    """Return sentences, none without problems. ``port`` is None for a target without a serial port."""
    answered = [each for each in found if each.identity is not None]
    if not answered:
        return list(_silence(port, found))
    best = max(answered, key=lambda each: (each.problem is None, each.steps_per_s or 0.0))
    return [
        *_state(answered[0]),
        *_firmware(best, expected_hash),
        *_problems(answered),
        *_latency(port, best),
        *_losses(answered),
        *_rate(best),
    ]


def _silence(port: Port | None, found: Sequence[Measurement]) -> Iterator[str]:
    if port is None:
        yield "The target started, but does not answer: its program is faulty."
        return
    bauds = ", ".join(str(each.baud) for each in found)
    yield (
        f"Nothing answers on {port.device} at {bauds} baud. Is the firmware flashed, and does it run (its lamp "
        "blinks)? Is its baud rate another one (--baud)? A debug probe has two ports, and the other one may be the "
        "target's. Does another program read from this one?"
    )


def _state(first: Measurement) -> Iterator[str]:
    state = None if first.before is None else state_words(first.before["state"])
    if state == RESTARTED:
        yield (
            "The target was restarted by its watchdog: its program, or an interrupt, hung. Its counters began anew "
            "then; a flight that was under way has ended."
        )
    elif state == SAFE:
        yield "The target was in its safe state, rotors stopped: its last flight gave it bad input."


def _problems(answered: Sequence[Measurement]) -> Iterator[str]:
    for each in answered:
        if each.problem is not None:
            yield f"At {_rate_words(each)} the target {each.problem}: the exchanges ended there."


def _firmware(best: Measurement, expected_hash: str) -> Iterator[str]:
    identity = best.identity or {}
    if identity["source_hash"] != expected_hash:
        yield (
            f"The firmware was made of other sources ({identity['source_hash']}) than these ({expected_hash}): build "
            "and flash it again, or nothing will fly on it."
        )
    if identity["real_octets"] != 4:
        yield f"Its loops compute with {8 * identity['real_octets']} bits, not with 32: build it without FS_DOUBLE."


def _latency(port: Port | None, best: Measurement) -> Iterator[str]:
    median_s, wire_s = best.percentile_s(50.0), best.wire_s
    if port is None or median_s is None or wire_s is None:
        return
    known = port.latency_ms is not None and port.latency_ms > 1.0
    if not known and median_s - wire_s <= _SLACK_S:
        return
    extra_ms = (median_s - wire_s) * 1e3
    words = f"An exchange takes {extra_ms:.1f} ms more than its time on the wire"
    if known:
        yield (
            f"{words}; the bridge's latency timer is {port.latency_ms:g} ms: set it to 1 ms, with "
            f"echo 1 | sudo tee {port.latency_path}"
        )
    else:
        yield (
            f"{words}. A bridge of FTDI waits {FTDI_LATENCY_MS:g} ms unless its latency timer is set to 1 ms; another "
            "USB port, without a hub, may help as well."
        )


def _losses(answered: Sequence[Measurement]) -> Iterator[str]:
    for each in answered:
        troubles = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in each.troubles.items())
        told = f" (the target counted: {troubles})" if troubles else ""
        if each.loss > _MUCH_LOSS:
            yield f"At {_rate_words(each)} {each.loss:.1%} of the exchanges were lost{told}: choose a lower baud rate."
        elif each.lost or troubles:
            yield (
                f"At {_rate_words(each)} {each.lost} exchanges were repeated{told}: flights take longer by it, and "
                "nothing else."
            )


def _rate_words(each: Measurement) -> str:
    return "this line" if each.baud is None else f"{each.baud} baud"


def _rate(best: Measurement) -> Iterator[str]:
    rate = best.steps_per_s
    if best.baud is not None and rate is not None and rate < _INNER_HZ:
        yield (
            f"{rate:.0f} steps/s: a flight of 60 s at {_INNER_HZ:g} Hz takes {60.0 * _INNER_HZ / rate:.0f} s. It flies "
            "in simulated time, so nothing of it changes; a higher baud rate makes it shorter."
        )
