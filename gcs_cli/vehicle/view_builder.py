"""The view of a vehicle after each of its messages, built when it is read. Pure."""

from __future__ import annotations

from typing import Any

from gcs_cli.vehicle.link_counts import LinkCounter, LinkCounts
from gcs_cli.vehicle.status_texts import without_stale_piece
from gcs_cli.vehicle.vehicle_view import FOLDS, MEASUREMENTS, TIMES
from gcs_cli.vehicle.view_types import Changes, Identity, VehicleView, view_with

_NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: a ground station, a camera …
_RESTART_S = 0.25
"""Step back of the vehicle's clock that no reordering of datagrams explains."""


class ViewBuilder:
    """Folds messages; ``view`` is the state after the last one.

    A view has some 40 values. A measurement changes a few of them 50 times a second, and a view is read 10 times a
    second: the newest measurement of each type is kept until then, or until another message is folded. Only one thread
    may use a builder.
    """

    def __init__(self, view: VehicleView) -> None:
        """Continue from ``view``."""
        self.identity = view.identity
        """Address and type of the vehicle; None before its first heartbeat."""
        self.time_s = view.time_s
        """The vehicle's clock; None if unknown."""
        self._view = view
        """The view before the measurements in ``_newest``."""
        self._newest: dict[str, Any] = {}
        """The newest message of each type of measurements, in the order of their arrival."""
        self._counter = LinkCounter(view.link)

    @property
    def view(self) -> VehicleView:
        """The state of the vehicle."""
        if self.link is not self._view.link:
            self._change({"link": self.link})
        return self._folded()

    @property
    def link(self) -> LinkCounts:
        """Counts of the vehicle's messages."""
        return self._counter.counts

    @property
    def last_heartbeat_s(self) -> float | None:
        """Time at which the newest heartbeat was received."""
        return self._view.last_heartbeat_s

    def note_quality(self, round_trip_s: float | None, recent_loss: float | None) -> None:
        """Keep the newest round trip and loss in the view."""
        self._counter.note_quality(round_trip_s, recent_loss)

    def add(self, message: Any, now_s: float) -> bool:
        """Fold a message, received at ``now_s``; return False, and ignore it, if it is not the vehicle's.

        The first heartbeat of an autopilot selects the vehicle.
        """
        identity = self.identity or self._identify(message)
        if identity is None or message.get_srcSystem() != identity.system_id:
            return False
        if message.get_srcComponent() != identity.component_id:
            return False
        self._counter.count(message.get_seq(), now_s)
        if self._view.partial_text is not None:
            self._change(without_stale_piece(self._folded(), now_s))
        name = message.get_type()
        if name in TIMES:
            self._advance(TIMES[name](message) / 1e3)
        if name in MEASUREMENTS:
            self._newest.pop(name, None)
            self._newest[name] = message
        elif name in FOLDS:
            self._change(FOLDS[name](self._folded(), message, now_s))
        return True

    def _identify(self, message: Any) -> Identity | None:
        """Return the sender of an autopilot's heartbeat as the vehicle."""
        if message.get_type() != "HEARTBEAT" or message.autopilot == _NO_AUTOPILOT:
            return None
        sender = message.get_srcSystem(), message.get_srcComponent()
        self.identity = Identity(*sender, message.type, message.autopilot)
        self._view = self._view._replace(identity=self.identity)
        return self.identity

    def _advance(self, time_s: float) -> None:
        """Take the vehicle's clock from a message."""
        before_s, self.time_s = self.time_s, time_s
        if before_s is not None and time_s <= before_s - _RESTART_S:
            restarts = self._folded().restarts + 1
            self._change({"restarts": restarts, "timing": None})  # the timing is of the loops before

    def _change(self, changes: Changes) -> None:
        if changes:
            self._view = view_with(self._view, changes)

    def _folded(self) -> VehicleView:
        """Return the view with all measurements; its ``link`` may be older."""
        newest, self._newest = self._newest, {}
        for name, message in newest.items():
            self._change(MEASUREMENTS[name](self._view, message))
        if self.time_s != self._view.time_s:
            self._change({"time_s": self.time_s})
        return self._view


def update(view: VehicleView, message: Any, now_s: float) -> VehicleView:
    """Return ``view`` after ``message``, received at ``now_s``; messages of others are ignored."""
    builder = ViewBuilder(view)
    builder.add(message, now_s)
    return builder.view
