"""Loss of the ground link and of streams, on the clocks of both vehicle and link. No I/O."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable

from flightstack.commander.conditions import LinkFacts
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.vehicle.flight_state import FlightState


class SilenceTimer:
    """Watches a link on the vehicle's clock and on the links' own.

    A link is silent only if nothing came within its timeout on both. At fifty times real time a ground station that
    sends once per second of wall time is silent for fifty simulated seconds; while simulated time stands still, it is
    silent for no simulated time at all. Neither is a loss.
    """

    def __init__(self) -> None:
        self._heard: tuple[float, int] | None = None

    def heard(self, now_s: float, time_us: int) -> None:
        """Note a message at link time ``now_s`` and vehicle time ``time_us``."""
        self._heard = now_s, time_us

    def silent(self, now_s: float, time_us: int, limit_s: float) -> bool:
        """Return True if nothing came within ``limit_s`` on both clocks, or ever."""
        if self._heard is None:
            return True
        heard_s, heard_us = self._heard
        return now_s - heard_s > limit_s and (time_us - heard_us) * 1e-6 > limit_s

    def lost(self, now_s: float, time_us: int, limit_s: float) -> bool:
        """Return True if the link is silent after it was heard; one that was never heard is not lost."""
        return self._heard is not None and self.silent(now_s, time_us, limit_s)


class StreamMonitor:
    """Reports the begin and the loss of a stream."""

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
        self._watch = SilenceTimer()
        self._is_lost = True

    def heard(self, now_s: float) -> None:
        """Note a message of the stream at link time ``now_s``; the next message may select a mode."""
        self._watch.heard(now_s, self._vehicle_time_us())
        self._note(False)

    def check(self, now_s: float) -> None:
        """Evaluate the timeout."""
        self._note(self._watch.silent(now_s, self._vehicle_time_us(), self._timeout_s()))

    def _note(self, lost: bool) -> None:
        if lost is not self._is_lost:
            self._is_lost = lost
            self._report_lost(lost)


def stream_monitors(now: FlightState, links: LinkFacts) -> tuple[StreamMonitor, StreamMonitor]:
    """Return the monitors of offboard setpoints and of manual control, which keep ``links`` up to date."""

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
    """A ground station is lost when none of them sent a heartbeat for COM_DL_LOSS_T.

    Only MAV_TYPE_GCS counts, as with PX4: a companion computer's heartbeat does not keep a link alive. A ground
    station that was never heard since boot counts as lost if NAV_DLL_ACT has an action, and not otherwise: scripts may
    then fly the vehicle alone.
    """

    handles = frozenset({"HEARTBEAT"})

    def __init__(self, now: FlightState, links: LinkFacts) -> None:
        self._now = now
        self._links = links
        self._watch = SilenceTimer()

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a heartbeat."""
        if message.type == mavlink.MAV_TYPE_GCS:
            self._watch.heard(now_s, self._now.time_us)
            # at once: the next message may be the command to arm
            self._links.gcs_heard, self._links.gcs_lost = True, False

    def poll(self, now_s: float) -> Iterable[tuple[Hashable | None, Message]]:
        """Update the link facts; there is nothing to send."""
        links, behaviour = self._links, self._now.behaviour
        if links.gcs_heard:
            links.gcs_lost = self._watch.lost(now_s, self._now.time_us, behaviour.gcs_loss_s)
        else:
            links.gcs_lost = behaviour.gcs_loss_action > 0
        return ()

    def next_deadline(self) -> float | None:
        """Never: the hub polls at least as often as it sends heartbeats."""
        return None
