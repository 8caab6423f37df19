"""Timeout of requests from the measured round trip, as TCP computes it (RFC 6298). Pure."""

from __future__ import annotations

_GAIN, _VARIATION_GAIN, _VARIATIONS = 1 / 8, 1 / 4, 4.0
_SMALLEST_MARGIN_S = 0.05


class AnswerTimeout:
    """Mean round trip and four times its variation, between ``least_s`` and ``most_s``."""

    def __init__(self, first_s: float, least_s: float, most_s: float) -> None:
        self.value_s = first_s
        """The timeout [s]; ``first_s`` before a measurement."""
        self._least_s, self._most_s = least_s, most_s
        self.round_trip_s = 0.0
        """Mean round trip; 0 before a measurement."""
        self._variation_s = 0.0

    def measure(self, answer_s: float) -> None:
        """Take the time from a request to its own answer: one of several equal requests measures nothing."""
        if not self.round_trip_s:
            self.round_trip_s, self._variation_s = answer_s, answer_s / 2.0
        else:
            self._variation_s += _VARIATION_GAIN * (abs(answer_s - self.round_trip_s) - self._variation_s)
            self.round_trip_s += _GAIN * (answer_s - self.round_trip_s)
        margin_s = max(_SMALLEST_MARGIN_S, _VARIATIONS * self._variation_s)
        self._set(self.round_trip_s + margin_s)

    def _set(self, value_s: float) -> None:
        self.value_s = min(self._most_s, max(self._least_s, value_s))
