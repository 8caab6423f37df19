"""Loss of the ground link and of streams, on the clocks of both vehicle and link. No I/O."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable

from flightstack.commander.conditions import LinkFacts
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.vehicle.flight_state import FlightState


class SilenceTimer:
    """Watches a link on the vehicle's clock and on the links' own.

    A link is silent only when nothing came for its time on both. At fifty times real time a ground station that
    speaks once per second of the wall is silent for fifty simulated seconds; while simulated time stands still,
    for as long as that takes. Neither is a loss.
    """

    def __init__(self) -> None:
        self._heard: tuple[float, int] | None = None

    def heard(self, now_s: float, time_us: int) -> None:
        """Note a sign of life at link time ``now_s`` and vehicle time ``time_us``."""
        self._heard = now_s, time_us

    def silent(self, now_s: float, time_us: int, limit_s: float) -> bool:
        """Tell whether nothing came for ``limit_s`` on both clocks, or ever."""
        if self._heard is None:
            return True
        heard_s, heard_us = self._heard
        return now_s - heard_s > limit_s and (time_us - heard_us) * 1e-6 > limit_s

    def lost(self, now_s: float, time_us: int, limit_s: float) -> bool:
        """Tell whether it is silent after it was heard; who never spoke is not lost."""
        return self._heard is not None and self.silent(now_s, time_us, limit_s)


class StreamMonitor:
    """Reports a stream that begins, or falls silent for a time-out by both clocks."""

    def __init__(
        self,
        vehicle_time_us: Callable[[], int],
        timeout_s: Callable[[], float],
        report_lost: Callable[[bool], None],
    ) -> None:
        """Use ``timeout_s`` for the time-out in force, and tell ``report_lost`` whenever the answer changes."""
        self._vehicle_time_us = vehicle_time_us
        self._timeout_s = timeout_s
        self._report_lost = report_lost
        self._watch = SilenceTimer()
        self._is_lost = True

    def heard(self, now_s: float) -> None:
        """Note a message of the stream at the link's time ``now_s``: a mode may be chosen with the next one."""
        self._watch.heard(now_s, self._vehicle_time_us())
        self._note(False)

    def check(self, now_s: float) -> None:
        """Find out whether the stream has fallen silent."""
        self._note(self._watch.silent(now_s, self._vehicle_time_us(), self._timeout_s()))

    def _note(self, lost: bool) -> None:
        if lost is not self._is_lost:
            self._is_lost = lost
            self._report_lost(lost)


class GroundLinkMonitor:
    """A ground station is lost when none of them sent a heartbeat for COM_DL_LOSS_T.

    Only MAV_TYPE_GCS counts, as with PX4: a companion computer's heartbeat does not keep a link alive. Who was never
    heard since the vehicle booted counts as lost too if NAV_DLL_ACT asks for an action, and not otherwise: then
    scripts may fly the vehicle alone.
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
