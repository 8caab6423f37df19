"""When a link counts as lost, on two clocks. Pure."""

from __future__ import annotations


class LinkWatch:
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
