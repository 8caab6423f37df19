"""Timeouts of the ground link and of streams, in vehicle time. No I/O."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable

from flightstack.commander.inputs import LinkFacts
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.vehicle.flight_state import FlightState


class SilenceTimer:
    """Measures the silence of a link in vehicle time.

    In lockstep that is simulated time: a loss is the same at any speed, and while time stands still nothing is lost. A
    client that sends by the machine's clock sends less often in simulated time the faster the simulation runs.
    """

    def __init__(self) -> None:
        self._heard_us: int | None = None

    @property
    def is_new(self) -> bool:
        """True if the link was never heard."""
        return self._heard_us is None

    def heard(self, time_us: int) -> None:
        """Restart the timer."""
        self._heard_us = time_us

    def silent_s(self, time_us: int) -> float:
        """Return for how long the link has been silent [s]; infinite if it was never heard."""
        return math.inf if self._heard_us is None else (time_us - self._heard_us) * 1e-6

    def silent(self, time_us: int, limit_s: float) -> bool:
        """Return True if the link was silent for ``limit_s``, or was never heard."""
        return self.silent_s(time_us) > limit_s

    def lost(self, time_us: int, limit_s: float) -> bool:
        """Return True if the link was heard and is silent now."""
        return self._heard_us is not None and self.silent(time_us, limit_s)


class StreamMonitor:
    """Reports the start and the loss of a stream."""

    def __init__(
        self,
        vehicle_time_us: Callable[[], int],
        timeout_s: Callable[[], float],
        report_lost: Callable[[bool], None],
    ) -> None:
        """Call ``report_lost`` at each change; ``timeout_s`` returns the timeout in force."""
        self._vehicle_time_us = vehicle_time_us
        self._timeout_s = timeout_s
        self._report_lost = report_lost
        self._timer = SilenceTimer()
        self._is_lost = True

    def heard(self) -> None:
        """Restart the timeout, and report the start at once: a mode change may follow."""
        self._timer.heard(self._vehicle_time_us())
        self._set_lost(False)

    def next_deadline(self) -> float | None:
        """Return −inf for a stream that has begun, whose timeout counts vehicle time, else None."""
        return None if self._timer.is_new else -math.inf

    def check(self) -> None:
        """Evaluate the timeout."""
        self._set_lost(self._timer.silent(self._vehicle_time_us(), self._timeout_s()))

    def _set_lost(self, lost: bool) -> None:
        if lost is not self._is_lost:
            self._is_lost = lost
            self._report_lost(lost)


def stream_monitors(now: FlightState, links: LinkFacts) -> tuple[StreamMonitor, StreamMonitor]:
    """Return the monitors of offboard setpoints and of manual control, which update ``links``."""

    def vehicle_time_us() -> int:
        return now.time_us

    def set_offboard_lost(lost: bool) -> None:
        links.offboard_lost = lost

    def set_manual_lost(lost: bool) -> None:
        links.manual_lost = lost

    return (
        StreamMonitor(vehicle_time_us, lambda: now.behaviour.offboard_loss_s, set_offboard_lost),
        StreamMonitor(vehicle_time_us, lambda: now.behaviour.manual_loss_s, set_manual_lost),
    )


class GroundLinkMonitor:
    """Reports the data link as lost if no ground station sent a heartbeat for COM_DL_LOSS_T.

    As in PX4, only heartbeats of MAV_TYPE_GCS count, not those of companion computers. Before the first heartbeat
    since boot the link counts as lost only if NAV_DLL_ACT has an action, so that scripts may fly without one.
    """

    handles = frozenset({"HEARTBEAT"})

    def __init__(self, now: FlightState, links: LinkFacts) -> None:
        self._now = now
        self._links = links
        self._timer = SilenceTimer()

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a heartbeat."""
        if message.type == mavlink.MAV_TYPE_GCS:
            self._timer.heard(self._now.time_us)
            # not in ``poll``: the next message may be the arm command
            self._links.gcs_heard, self._links.gcs_lost = True, False

    def poll(self, now_s: float) -> Iterable[tuple[Hashable | None, Message]]:
        """Update the link facts. Send nothing."""
        links, behaviour = self._links, self._now.behaviour
        if links.gcs_heard:
            links.gcs_lost = self._timer.lost(self._now.time_us, behaviour.gcs_loss_s)
        else:
            links.gcs_lost = behaviour.gcs_loss_action > 0
        return ()

    def next_deadline(self) -> float | None:
        """Return −inf: the timeout counts vehicle time, and before the first heartbeat NAV_DLL_ACT decides."""
        return -math.inf

    def idle_s(self) -> float:
        """Return the vehicle time for which ``poll`` changes nothing, if no message arrives [s]."""
        links, behaviour = self._links, self._now.behaviour
        if links.gcs_heard and not links.gcs_lost:
            return behaviour.gcs_loss_s - self._timer.silent_s(self._now.time_us)
        is_settled = links.gcs_heard or links.gcs_lost is (behaviour.gcs_loss_action > 0)
        return math.inf if is_settled else 0.0
