"""Inputs of the failsafe monitor: links, battery, age of the state. Types only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass
class LinkFacts:
    """State of the ground links; each service writes its own field."""

    gcs_lost: bool = False
    """True after the heartbeat timeout; with a loss action configured, also before the first heartbeat."""
    gcs_heard: bool = False
    """True if a ground station heartbeat was received since boot."""
    offboard_lost: bool = True
    manual_lost: bool = True


class BatteryReading(Protocol):
    """A battery measurement."""

    @property
    def remaining(self) -> float:
        """Remaining charge, 0 to 1."""
        ...

    @property
    def valid(self) -> bool:
        """True if the charge is known."""
        ...


class Freshness(Protocol):
    """Age of the state."""

    @property
    def age_us(self) -> int:
        """Vehicle time since the newest state was received."""
        ...

    @property
    def frozen_us(self) -> int:
        """Vehicle time since any value of the state changed."""
        ...


class StateSource(Protocol):
    """Source of states and battery measurements; implemented by ``SimulatorEndpoint``."""

    @property
    def battery(self) -> BatteryReading:
        """Newest battery measurement."""
        ...

    @property
    def step_refusal(self) -> str:
        """Reason that the time steps between states cannot be flown; empty if they can."""
        ...

    def freshness(self, now_us: int) -> Freshness:
        """Return the age of the state at vehicle time ``now_us``."""
        ...
