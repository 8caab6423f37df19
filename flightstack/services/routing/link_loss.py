"""Notes when the ground stations were last heard, for the failsafe of a lost link."""

from __future__ import annotations

from collections.abc import Hashable, Iterable

from flightstack.commander.conditions import LinkFacts
from flightstack.commander.link_watch import LinkWatch
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.vehicle.flight_state import FlightState


class LinkLossService:
    """A ground station is lost when none of them sent a heartbeat for COM_DL_LOSS_T.

    Only MAV_TYPE_GCS counts, as with PX4: a companion computer's heartbeat does not keep a link alive. Who was never
    heard since the vehicle booted counts as lost too if NAV_DLL_ACT asks for an action, and not otherwise: then
    scripts may fly the vehicle alone.
    """

    handles = frozenset({"HEARTBEAT"})

    def __init__(self, now: FlightState, links: LinkFacts) -> None:
        self._now = now
        self._links = links
        self._watch = LinkWatch()

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
