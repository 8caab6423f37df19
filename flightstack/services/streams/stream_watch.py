"""Whether a stream to the vehicle is alive, by the clocks of both vehicle and link."""

from __future__ import annotations

from collections.abc import Callable

from flightstack.commander.link_watch import LinkWatch


class StreamWatch:
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
        self._watch = LinkWatch()
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
