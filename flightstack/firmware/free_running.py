"""Link to a free-running target without I/O: states out, rotor commands and timing in."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from flightstack.core.contract import LoopFlags
from flightstack.core.float32 import as_float32
from flightstack.firmware.pil_steps import BAD_INPUT, OWN_COMPONENT, OWN_SYSTEM
from flightstack.mavlink.dialect import LAYOUT_BY_NAME
from flightstack.mavlink.frames import HEADER_V2, FrameReader, pack_frame
from flightstack.mavlink.link import Link

REST = 16
"""Bit of FS_PIL_STATE.flags beside ``LoopFlags``: the flight has ended."""
DRIVE_TIMEOUT_S = 0.5
"""Time without a rotor command after which the target counts as lost."""
_STATE, _DRIVE, _TIMING = (LAYOUT_BY_NAME[f"FS_PIL_{name}"] for name in ("STATE", "DRIVE", "TIMING"))
_STATE_PAYLOAD, _DRIVE_PAYLOAD = struct.Struct(_STATE.format), struct.Struct(_DRIVE.format)
_TIME_MASK = 0xFFFF_FFFF
_TOTALS = ("ticks", "missed", "overruns", "states", "skipped", "held", "timeouts")


class FreeRunning:
    """States of one flight after another, and the newest commands. Times are of the host's clock."""

    def __init__(self) -> None:
        self._codec, self._reader = Link(OWN_SYSTEM, OWN_COMPONENT), FrameReader()
        self._sequence = 0
        self._began_us = 0
        self._is_flying = False
        self._is_begun = False
        self._heard_s = 0.0
        self._delays_us: list[int] = []
        self._windows: list[dict[str, Any]] = []
        self.texts: deque[str] = deque(maxlen=10)
        self.commands: tuple[float, ...] = (0.0,) * 8
        """Rotor speed commands [rad/s] of the newest FS_PIL_DRIVE of this flight, zero before the first one."""
        self.attitude: tuple[float, ...] | None = None
        """Its attitude reference (4) and attitude target (5), None before the first one."""
        self.status = 0
        """Its status."""

    def state(self, flags: int, numbers: Sequence[float], now_s: float) -> bytes:
        """Return the frame of a state; a flight begins with the flag RESET, and ends with REST.

        RESET is repeated until a command shows that it arrived.
        """
        now_us = self._time_us(now_s)
        if flags & LoopFlags.RESET:
            if not self._is_flying:
                self.commands, self.attitude, self._heard_s = (0.0,) * 8, None, now_s
            self._is_flying, self._is_begun, self._began_us, self.status = True, False, now_us, 0
        elif flags & REST:
            self._is_flying = False
        elif not self._is_begun:
            flags |= LoopFlags.RESET
        try:
            payload = _STATE_PAYLOAD.pack(now_us, flags, *numbers)
        except OverflowError:  # beyond float32
            payload = _STATE_PAYLOAD.pack(now_us, flags, *map(as_float32, numbers))
        self._sequence = (self._sequence + 1) & 255
        cut = payload.rstrip(b"\0") or b"\0"
        return pack_frame(_STATE.message_id, cut, _STATE.crc_extra, self._sequence, OWN_SYSTEM, OWN_COMPONENT)

    def receive(self, data: bytes, now_s: float) -> None:
        """Process received bytes."""
        for frame in self._reader.feed(data):
            if frame.message_id == _DRIVE.message_id:
                payload = frame.data[HEADER_V2 : HEADER_V2 + frame.data[1]].ljust(_DRIVE_PAYLOAD.size, b"\0")
                self._take_drive(_DRIVE_PAYLOAD.unpack(payload[: _DRIVE_PAYLOAD.size]), now_s)
            elif frame.known:
                for message in self._codec.decode(frame.data):
                    if message.get_type() == _TIMING.name:
                        self._windows.append(message.to_dict())
                    elif message.get_type() == "STATUSTEXT":
                        self.texts.append(message.text)

    def _take_drive(self, values: tuple[Any, ...], now_s: float) -> None:
        state_us, status, now_us = values[0], values[1], self._time_us(now_s)
        since_us, elapsed_us = ((time - self._began_us) & _TIME_MASK for time in (state_us, now_us))
        if not self._is_flying or since_us > elapsed_us:  # of an earlier flight, or at rest
            return
        self._heard_s = now_s
        self.attitude, self.commands, self.status = values[4:13], values[13:], status
        if not status & BAD_INPUT:
            self._is_begun = True
            self._delays_us.append(elapsed_us - since_us)

    def failure(self, now_s: float) -> str | None:
        """Return why the flight cannot go on, as a clause about the target, or None."""
        if self._is_flying and self.status & BAD_INPUT:
            return "stopped its rotors" + (f": {self.texts[-1]}" if self.texts else "")
        if self._is_flying and now_s - self._heard_s > DRIVE_TIMEOUT_S:
            return f"sent no rotor commands for {DRIVE_TIMEOUT_S:g} s"
        return None

    def figures(self) -> dict[str, Any]:
        """Return counts, jitter and delays of all flights, for the record; means are over ticks."""
        windows, delays_us = self._windows, np.array(self._delays_us or [0], np.float64)
        ticks = [window["ticks"] for window in windows]
        return {
            **{name: sum(window[name] for window in windows) for name in _TOTALS},
            "period_us": windows[-1]["period_us"] if windows else None,
            "late_mean_us": _weighted(windows, "late_mean_us", ticks),
            "late_max_us": max((window["late_max_us"] for window in windows), default=None),
            "state_age_mean_us": _weighted(windows, "age_mean_us", ticks),
            "state_age_max_us": max((window["age_max_us"] for window in windows), default=None),
            "cost_max": max((window["cost_max"] for window in windows), default=None),
            "commands": len(self._delays_us),
            "end_to_end_mean_us": float(delays_us.mean()),
            "end_to_end_p99_us": float(np.percentile(delays_us, 99)),
            "end_to_end_max_us": float(delays_us.max()),
        }

    @staticmethod
    def _time_us(now_s: float) -> int:
        return round(now_s * 1e6) & _TIME_MASK


def _weighted(windows: Sequence[dict[str, Any]], name: str, ticks: Sequence[int]) -> float | None:
    values = [
        (window[name], count) for window, count in zip(windows, ticks, strict=True) if window[name] > 0.0
    ]
    total = sum(count for _, count in values)
    return sum(value * count for value, count in values) / total if total else None
