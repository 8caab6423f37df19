"""Messages of a vehicle by their sequence numbers: received, lost, late, and their rate. Pure."""

from __future__ import annotations

from typing import NamedTuple

_RATE_WINDOW_S = 1.0
_MOST_LATE = 32
"""Messages that may overtake another one: PX4 sends from several threads."""
_ALL_LATE = (1 << _MOST_LATE + 1) - 1
_SILENCE_S = 3.0
"""Silence after which the sequence may have begun anew, or wrapped: the messages in it do not count as lost."""
_LARGEST_GAP = 128
"""Of lost messages; larger gaps in the sequence are a sender that began anew."""


class LinkCounts(NamedTuple):
    """Messages from the vehicle: received, missing in the sequence, and the recent rate [1/s]."""

    received: int = 0
    lost: int = 0
    last_sequence: int | None = None
    last_received_s: float | None = None
    rate_hz: float | None = None
    window_start_s: float | None = None
    window_count: int = 0
    round_trip_s: float | None = None
    """Time from the newest answered TIMESYNC to its answer; None without one."""
    recent_loss: float | None = None
    """Share of the messages that were lost in the last 10 s, 0 to 1; None if it is not measured."""
    missing: int = 0
    """Bit k: the message k before ``last_sequence`` counts as lost."""
    stray: int | None = None
    """The newest message, if it is before ``last_sequence`` and did not count as lost."""

    @property
    def quality(self) -> float | None:
        """Share of the vehicle's messages that arrived in the last 10 s, else in all, 0 to 1."""
        if self.recent_loss is not None:
            return 1.0 - self.recent_loss
        total = self.received + self.lost
        return self.received / total if total else None


class _Sequence(NamedTuple):
    """The counts of ``LinkCounts`` that follow from sequence numbers."""

    lost: int
    last_sequence: int | None
    missing: int
    stray: int | None


def _following(link: LinkCounts, sequence: int, now_s: float) -> _Sequence:
    """Return the counts of losses after a message with this sequence number."""
    lost, last, missing, stray = link.lost, link.last_sequence, link.missing, link.stray
    if last is None or link.last_received_s is None or now_s - link.last_received_s > _SILENCE_S:
        return _Sequence(lost, sequence, 0, None)
    late = (last - sequence) % 256
    if late == 0:  # repeated
        return _Sequence(lost, last, missing, stray)
    begins_anew = stray is not None and sequence == (stray + 1) % 256
    if late <= _MOST_LATE and not begins_anew:
        if missing >> late & 1:  # overtaken by later ones, which counted it as lost
            return _Sequence(lost - 1, last, missing ^ 1 << late, stray)
        return _Sequence(lost, last, missing, sequence)  # repeated, or of a sender that began anew
    gap = (sequence - last - 1) % 256
    if begins_anew or gap > _LARGEST_GAP:
        return _Sequence(lost, sequence, 0, None)
    return _Sequence(lost + gap, sequence, (missing << gap + 1 | (1 << gap + 1) - 2) & _ALL_LATE, None)


def counted(link: LinkCounts, sequence: int, now_s: float) -> LinkCounts:
    """Return the counts after a message with this sequence number."""
    start, count, rate, last = link.window_start_s, link.window_count + 1, link.rate_hz, link.last_received_s
    if start is None or last is None or (rate is None and now_s == start):
        start, count = now_s, 0  # read at once with the first message: a backlog has no rate
    elif now_s != last and last - start >= _RATE_WINDOW_S:  # messages read at one time belong to one window
        start, count, rate = last, 1, link.window_count / (last - start)
    lost, last_sequence, missing, stray = _following(link, sequence, now_s)
    measured = link.round_trip_s, link.recent_loss
    return LinkCounts(
        link.received + 1, lost, last_sequence, now_s, rate, start, count, *measured, missing, stray
    )
