"""Offboard setpoints. The newest message of any sender counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

from flightstack.guidance.setpoints import OffboardSetpoint
from flightstack.mavlink.link import Address, Message, is_for
from flightstack.services.streams.link_loss import StreamMonitor
from flightstack.services.streams.setpoint_messages import PoseReference, read_setpoint

_WARNING_INTERVAL_S = 10.0  # setpoints come at 50 Hz


class SetpointServer:
    """Takes SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT and SET_ATTITUDE_TARGET."""

    handles = frozenset(
        {"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET"}
    )

    def __init__(
        self,
        own: Address,
        reference: Callable[[], PoseReference],
        accept: Callable[[OffboardSetpoint], None],
        warn: Callable[[str], None],
        monitor: StreamMonitor,
    ) -> None:
        """Pass accepted setpoints to ``accept`` and the texts of refusals to ``warn``."""
        self._own = own
        self._reference = reference
        self._accept = accept
        self._warn = warn
        self._monitor = monitor
        self._warned_s = -math.inf

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a setpoint. A refused one neither replaces the last one nor restarts the stream's timeout."""
        if not is_for(message, self._own):
            return
        setpoint = read_setpoint(message, self._reference)
        if not isinstance(setpoint, str):
            self._accept(setpoint)
            self._monitor.heard()
        elif now_s - self._warned_s >= _WARNING_INTERVAL_S:
            self._warned_s = now_s
            self._warn(f"Setpoint refused: {setpoint}")

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Evaluate the stream's timeout. Send nothing."""
        self._monitor.check()
        return []

    def next_deadline(self) -> float | None:
        """Return None: the timeout counts on the vehicle clock too, which advances only between polls."""
        return None
