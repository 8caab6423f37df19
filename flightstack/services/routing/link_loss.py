"""Notes when the ground stations were last heard, for the failsafe of a lost link."""

from __future__ import annotations

from collections.abc import Hashable, Iterable

from flightstack.commander.link_watch import LinkWatch
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.vehicle.autopilot import Autopilot


class LinkLossService:
    """A ground station is lost when none of them sent a heartbeat for COM_DL_LOSS_T.

    Only MAV_TYPE_GCS counts, as with PX4: a companion computer's heartbeat does not keep a link alive. Who was never
    heard since the vehicle booted counts as lost too if NAV_DLL_ACT asks for an action, and not otherwise: then
    scripts may fly the vehicle alone.
    """

    handles = frozenset({"HEARTBEAT"})

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._watch = LinkWatch()

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a heartbeat."""
        if message.type == mavlink.MAV_TYPE_GCS:
            self._watch.heard(now_s, self._autopilot.now.time_us)
            links = self._autopilot.links  # at once: the next message may be the command to arm
            links.gcs_heard, links.gcs_lost = True, False

    def poll(self, now_s: float) -> Iterable[tuple[Hashable | None, Message]]:
        """Tell the autopilot; there is nothing to send."""
        autopilot = self._autopilot
        links, behaviour = autopilot.links, autopilot.behaviour
        if links.gcs_heard:
            links.gcs_lost = self._watch.lost(now_s, autopilot.now.time_us, behaviour.gcs_loss_s)
        else:
            links.gcs_lost = behaviour.gcs_loss_action > 0
        return ()

    def next_deadline(self) -> float | None:
        """Never: the hub polls at least as often as it sends heartbeats."""
        return None
