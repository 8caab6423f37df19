"""Offboard setpoints; of several senders the newest message counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

from flightstack.guidance.setpoints import OffboardSetpoint
from flightstack.mavlink.link import Address, Message, is_for
from flightstack.services.streams.link_loss import StreamMonitor
from flightstack.services.streams.setpoint_messages import Here, read_setpoint

_SILENCE_S = 10.0  # between two texts about refused setpoints: they come at 50 Hz


class SetpointServer:
    """SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT and SET_ATTITUDE_TARGET."""

    handles = frozenset(
        {"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET"}
    )

    def __init__(
        self,
        own: Address,
        here: Callable[[], Here],
        take: Callable[[OffboardSetpoint], None],
        refuse: Callable[[str], None],
        watch: StreamMonitor,
    ) -> None:
        """Give accepted setpoints to ``take`` and texts about others to ``refuse``; ``here`` is the vehicle's pose."""
        self._own = own
        self._here = here
        self._take = take
        self._refuse = refuse
        self._watch = watch
        self._said_s = -math.inf

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a setpoint; one that is refused neither replaces the last nor keeps the stream alive."""
        if not is_for(message, self._own):
            return
        setpoint = read_setpoint(message, self._here)
        if not isinstance(setpoint, str):
            self._take(setpoint)
            self._watch.heard(now_s)
        elif now_s - self._said_s >= _SILENCE_S:
            self._said_s = now_s
            self._refuse(f"Setpoint refused: {setpoint}")

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Send nothing; note a stream that has fallen silent."""
        self._watch.check(now_s)
        return []

    def next_deadline(self) -> float | None:
        """Return None: a loss counts on the vehicle's clock too, which moves on only between polls."""
        return None
