"""Result of a conformance check."""

from __future__ import annotations

from typing import NamedTuple

PASSED, FAILED, NOT_CHECKED = "passed", "failed", "not checked"


class Check(NamedTuple):
    """One check: its result, the finding, and advice if it did not pass."""

    name: str
    result: str
    found: str
    advice: str = ""


def check_of(name: str, is_good: bool, found: str, advice: str) -> Check:
    """Return a check that passed or failed; the advice belongs to a failure."""
    return Check(name, PASSED, found) if is_good else Check(name, FAILED, found, advice)
