"""What the supervisor is told by others: links, battery, the state's age. Types only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass
class LinkFacts:
    """What the services of the ground links know; each writes its own field.

    Without a stream there are no setpoints and no sticks.
    """

    gcs_lost: bool = False
    """Silent for too long; if the loss has an action, also before the first heartbeat."""
    gcs_heard: bool = False
    """Whether a ground station has spoken since the vehicle booted."""
    offboard_lost: bool = True
    manual_lost: bool = True


class BatteryReading(Protocol):
    """What is known of the battery."""

    @property
    def remaining(self) -> float:
        """Share of the charge, 0 to 1."""
        ...

    @property
    def valid(self) -> bool:
        """Whether anything is known."""
        ...


class Freshness(Protocol):
    """How old the state is."""

    @property
    def age_us(self) -> int:
        """Vehicle time since the newest state arrived."""
        ...

    @property
    def frozen_us(self) -> int:
        """Vehicle time since any of its numbers changed."""
        ...


class StateSource(Protocol):
    """Where states come from, and what else is known there; ``SimulatorEndpoint`` is one."""

    @property
    def battery(self) -> BatteryReading:
        """The newest word about the battery."""
        ...

    @property
    def step_refusal(self) -> str:
        """Why the steps between states cannot be flown; empty if they can."""
        ...

    def freshness(self, now_us: int) -> Freshness:
        """Tell how old the state is at vehicle time ``now_us``."""
        ...
