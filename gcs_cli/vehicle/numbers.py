"""Numbers as people read them."""

from __future__ import annotations

UNKNOWN = "—"


def number(value: float | None, digits: int = 2, unit: str = "") -> str:
    """Format a number; a dash if unknown."""
    if value is None:
        return UNKNOWN
    if abs(value) >= 1e7:
        return f"{value:.1e}{unit}"
    return f"{round(value, digits) + 0.0:.{digits}f}{unit}"  # + 0.0: no -0.00
