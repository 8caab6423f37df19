"""Worlds on the true state, for tests of guidance, commands and protocols: sensors would add only noise and time.

Tests of what a user sees fly on ``flightstack.testing.World``, whose vehicle estimates its state from its sensors.
"""

from __future__ import annotations

from typing import Any

import flightstack.testing
from flightstack.params.config import TRUTH
from flightstack.testing import Setup


class World(flightstack.testing.World):
    """A world whose vehicle flies on the simulator's state, unless its setup or conditions say otherwise."""

    def __init__(self, setup: Setup | None = None, **options: Any) -> None:
        if setup is None:
            options = {"state": TRUTH} | options
        super().__init__(setup, **options)
