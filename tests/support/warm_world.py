"""Fly in a world on sensors and on the true state, so that tests that start side by side find its kernels compiled."""

from __future__ import annotations

from flightstack.params.config import STATES
from flightstack.testing import World


def main() -> None:
    """Fly the shortest mission on each state."""
    for state in STATES:
        with World(state=state, telemetry=True) as world:
            world.wait_until_ready()
            world.upload("hop")
            world.fly()


if __name__ == "__main__":
    main()
