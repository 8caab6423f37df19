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


class LinkCounter:
    """Counts the messages of a vehicle; ``counts`` is made when it is read."""

    __slots__ = (
        "_counts", "_last_received_s", "_last_sequence", "_lost", "_missing", "_quality", "_rate_hz", "_received",
        "_stray", "_window_count", "_window_start_s",
    )  # fmt: skip

    def __init__(self, counts: LinkCounts) -> None:
        """Continue from ``counts``."""
        self._counts: LinkCounts | None = counts
        self._received, self._lost = counts.received, counts.lost
        self._last_sequence, self._last_received_s = counts.last_sequence, counts.last_received_s
        self._rate_hz = counts.rate_hz
        self._window_start_s, self._window_count = counts.window_start_s, counts.window_count
        self._quality = counts.round_trip_s, counts.recent_loss
        self._missing, self._stray = counts.missing, counts.stray

    @property
    def counts(self) -> LinkCounts:
        """The counts now."""
        if self._counts is None:
            self._counts = LinkCounts(
                self._received, self._lost, self._last_sequence, self._last_received_s, self._rate_hz,
                self._window_start_s, self._window_count, *self._quality, self._missing, self._stray,
            )  # fmt: skip
        return self._counts

    def note_quality(self, round_trip_s: float | None, recent_loss: float | None) -> None:
        """Keep the newest round trip and loss, which are measured elsewhere."""
        if self._quality != (round_trip_s, recent_loss):
            self._quality = round_trip_s, recent_loss
            self._counts = None

    def count(self, sequence: int, now_s: float) -> None:
        """Count a message with this sequence number."""
        start_s, last_s = self._window_start_s, self._last_received_s
        self._window_count += 1
        if start_s is None or last_s is None or (self._rate_hz is None and now_s == start_s):
            # read at once with the first message: a backlog has no rate
            self._window_start_s, self._window_count = now_s, 0
        elif now_s != last_s and last_s - start_s >= _RATE_WINDOW_S:
            # messages read at one time belong to one window
            self._rate_hz = (self._window_count - 1) / (last_s - start_s)
            self._window_start_s, self._window_count = last_s, 1
        last = self._last_sequence
        if last is None or last_s is None or now_s - last_s > _SILENCE_S:
            self._begin(sequence)
        elif sequence == (last + 1) % 256 and self._stray is None:  # the usual case
            self._last_sequence, self._missing = sequence, self._missing << 1 & _ALL_LATE
        else:
            self._follow(sequence, last)
        self._received += 1
        self._last_received_s = now_s
        self._counts = None

    def _follow(self, sequence: int, last: int) -> None:
        """Count the losses between the messages ``last`` and ``sequence``."""
        stray = self._stray
        late = (last - sequence) % 256
        if late == 0:  # repeated
            return
        begins_anew = stray is not None and sequence == (stray + 1) % 256
        if late <= _MOST_LATE and not begins_anew:
            if self._missing >> late & 1:  # overtaken by later ones, which counted it as lost
                self._lost -= 1
                self._missing ^= 1 << late
            else:
                self._stray = sequence  # repeated, or of a sender that began anew
            return
        gap = 255 - late
        if begins_anew or gap > _LARGEST_GAP:
            self._begin(sequence)
            return
        self._lost += gap
        self._missing = (self._missing << gap + 1 | (1 << gap + 1) - 2) & _ALL_LATE
        self._last_sequence, self._stray = sequence, None

    def _begin(self, sequence: int) -> None:
        self._last_sequence, self._missing, self._stray = sequence, 0, None
