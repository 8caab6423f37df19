"""Errors that end a command; each text is one sentence for the user."""

from __future__ import annotations


class UsageProblemError(Exception):
    """An invalid argument."""


class PlantDivergedError(Exception):
    """The state of the plant is not finite, or the rotation per step is too large."""
