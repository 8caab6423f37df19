"""Monitor of the simulator's step lengths and speed. Pure."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.enums import Severity

LONGEST_FLYABLE_US = 10_000
"""Longest simulator step accepted for faster loops: both built-in vehicles fly the square at 16 ms, not at 20 ms."""
GAP_US = 50_000
"""A longer step is a gap, in which the loops pause as without states."""
WINDOW = 10
"""Number of consecutive steps per mean."""
CHANGE = 0.05
"""Relative change of the mean that is reported."""
PACE_SPAN_US = 5_000_000
PACE_TOLERANCE = 0.2
"""In real time: maximum relative difference between the simulator's and the machine's clock over ``PACE_SPAN_US``."""


class Notice(NamedTuple):
    """A text for the operator with its MAV_SEVERITY."""

    severity: int
    text: str


def is_gap(step_us: int) -> bool:
    """Return True if a step is a gap."""
    return step_us > GAP_US


class StateSteps:
    """Monitors steps between states that differ from the loops' ``interval_us``."""

    def __init__(self, interval_us: int) -> None:
        self._interval_us = interval_us
        self._sum_us = self._count = self._longest_us = 0
        self._mean_us = self._reported_us = float(interval_us)
        self._latest_us = 0
        self._quiet_until_us = 0
        self._pace_from: tuple[int, int] | None = None
        self._pace_is_off = False
        self._notices: list[Notice] = []

    @property
    def has_notices(self) -> bool:
        """True if there are new notices."""
        return bool(self._notices)

    def take_notices(self) -> list[Notice]:
        """Return new notices and clear them."""
        if not self._notices:
            return self._notices
        notices, self._notices = self._notices, []
        return notices

    def refusal(self, time_us: int) -> str:
        """Return why the loops cannot fly with the newest steps at ``time_us``; empty if they can."""
        is_over = time_us - self._latest_us > 2.0 * self._mean_us
        if is_over or self._mean_us <= max(LONGEST_FLYABLE_US, self._interval_us):
            return ""
        return (
            f"the simulator sends a state every {_ms(self._mean_us)}, the loops need one every "
            f"{_ms(LONGEST_FLYABLE_US)}, or --inner-hz {1e6 / self._mean_us:.4g}"
        )

    def differs(self, step_us: int, time_us: int) -> None:
        """Record a step to ``time_us`` that differs from ``interval_us``.

        The mean is of consecutive steps only: single irregular steps do not define a rate.
        """
        if time_us - step_us != self._latest_us:
            self._begin_window(time_us)
        self._latest_us = time_us
        self._sum_us += step_us
        self._count += 1
        gap = is_gap(step_us)
        self._longest_us = max(self._longest_us, 0 if gap else step_us)
        if self._count == WINDOW:
            self._mean_us = self._sum_us / WINDOW
            self._sum_us = self._count = self._longest_us = 0
            if abs(self._mean_us - self._reported_us) > CHANGE * self._reported_us:
                self._reported_us = self._mean_us
                self._report_mean(time_us)
        elif gap:
            self.jumps(step_us, time_us)

    def _begin_window(self, time_us: int) -> None:
        """Discard an interrupted window; report a step that was too long."""
        if self._longest_us > max(LONGEST_FLYABLE_US, self._interval_us):
            self.jumps(self._longest_us, time_us)
        self._sum_us = self._count = self._longest_us = 0

    def _report_mean(self, time_us: int) -> None:
        refusal = self.refusal(time_us)
        text = (
            f"Simulator sends a state every {_ms(self._mean_us)}; "
            f"the loops run every {_ms(self._interval_us)} on the newest one"
        )
        if refusal:
            self.tell(Severity.ERROR, "Not to be flown: " + refusal)
        else:
            self.tell(Severity.NOTICE, text)

    def jumps(self, step_us: int, time_us: int) -> None:
        """Report a step at ``time_us`` that is a gap or that the vehicle's clock does not follow."""
        if time_us < self._quiet_until_us:
            return
        self._quiet_until_us = time_us + 10_000_000
        way = "went back by" if step_us < 0 else "jumped ahead by"
        self.tell(Severity.WARNING, f"Simulator time {way} {abs(step_us) * 1e-6:.4g} s")

    def compare(self, time_us: int, machine_us: int) -> None:
        """Compare the simulator's clock with the machine's in real time; call periodically."""
        if self._pace_from is None:
            self._pace_from = time_us, machine_us
            return
        passed_us = machine_us - self._pace_from[1]
        if passed_us < PACE_SPAN_US:
            return
        pace = (time_us - self._pace_from[0]) / passed_us
        self._pace_from = time_us, machine_us
        is_off = abs(pace - 1.0) > PACE_TOLERANCE
        if is_off and not self._pace_is_off:
            says = f"runs at {pace:.2f} times real time" if pace > 0.0 else "clock stands still"
            self.tell(Severity.WARNING, f"Simulator {says}")
        self._pace_is_off = is_off

    def tell(self, severity: int, text: str) -> None:
        """Add a notice for the operator."""
        self._notices.append(Notice(severity, text))


def _ms(duration_us: float) -> str:
    return f"{duration_us * 1e-3:.4g} ms"
