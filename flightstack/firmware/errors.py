"""How a target ends a flight."""

from __future__ import annotations


class TargetError(RuntimeError):
    """The target cannot be flown any further; the text is one sentence for the user."""


class WrongFirmwareError(TargetError):
    """The target answers, but it cannot fly what it is asked to."""
