"""The errors that end a command; the text of each is one sentence for the user."""

from __future__ import annotations


class UsageProblemError(Exception):
    """A bad argument."""


class PlantDivergedError(Exception):
    """The state of the plant is no longer finite, or it spins too fast for the step."""
