"""Fly flights in this process and print the SHA-256 of their logs: a change of form changes none of them.

python -m tools.flight_hashes > before.txt; ...; python -m tools.flight_hashes | diff before.txt -
"""

from __future__ import annotations

import hashlib
from typing import Any

from flightstack.estimation.snapshot import ESTIMATOR_START
from flightstack.params.config import ESTIMATED, TRUTH
from flightstack.testing import World

GUSTY: dict[str, Any] = {"vehicle": "x_quad", "wind": (4.0, -2.0, 0.0), "gust": 1.0, "seed": 3}
FLIGHTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("square.plan", {}),
    ("square.plan", {"controller": "backstepping"}),
    ("square.plan", {"gains": "paper", "inner_hz": 1000.0, "ideal_rotors": True}),
    (
        "square.plan",
        {"controller": "backstepping", "gains": "paper", "inner_hz": 1000.0, "ideal_rotors": True},
    ),
    ("square.plan", {"vehicle": "x_quad"}),
    ("square.plan", {"vehicle": "x_quad", "controller": "backstepping"}),
    ("square.plan", {"loops": "c"}),
    ("square.plan", {"loops": "c", "controller": "backstepping", **GUSTY}),
    ("square.plan", {"plant": "paper"}),
    ("square.plan", {"plant": "multibody"}),
    ("square.plan", {"plant": "multibody", "vehicle": "x_quad", "controller": "backstepping"}),
    ("square.plan", GUSTY),
    ("square.plan", {**GUSTY, "controller": "backstepping", "torque_gust": 0.02}),
    ("hop.plan", {"inner_hz": 250.0, "outer_hz": 50.0}),
    ("hop.plan", {"loops": "host"}),
    ("hop.plan", {"loops": "emulated"}),
    ("square.plan", {"force": (0.3, 0.1, 0.0), "params": {"MIS_TAKEOFF_ALT": 4.0}}),
    ("fenced_square.plan", {**GUSTY, "loops": "c"}),
    ("triangle.waypoints", {"vehicle": "x_quad"}),
    ("every_item.plan", {**GUSTY, "seed": 5}),
    ("square.plan", {"state": ESTIMATED}),
    ("square.plan", {"state": ESTIMATED, "controller": "backstepping", **GUSTY}),
    ("hop.plan", {"state": ESTIMATED, "loops": "c", "boat": (1.0, 0.5)}),
    ("hop.plan", {"state": ESTIMATED, "plant": "multibody", "inner_hz": 250.0, "outer_hz": 50.0}),
)
"""Plans by vehicles, controllers, gains, plants, loops, rates and sources of the state; true unless they say so."""
LIMIT_S = 400.0
_HEADER, _MESSAGE_HEADER = 16, 3
"""Bytes of a log before its messages, and of a message before its content."""


def fly(plan: str, options: dict[str, Any]) -> str:
    """Return the SHA-256 of the log, without what a change of form alters.

    That is the version of the loops, which hashes C sources with their comments, and the layout of the estimator's
    memory at the start.
    """
    with World(**{"state": TRUTH, **options}) as world:
        world.upload(plan)
        world.wait_until_ready()
        world.arm()
        world.start_mission()
        world.run_until("not armed", LIMIT_S)
        version = world.engine.stack.loops.version.encode()
        log = _without_memory(world.engine.newest_log())
        return hashlib.sha256(log.replace(version, b"")).hexdigest()


def _without_memory(log: bytes) -> bytes:
    """Return a log without the messages that hold the memory of the estimator."""
    kept, at, key = [log[:_HEADER]], _HEADER, ESTIMATOR_START.encode()
    while at < len(log):
        size = _MESSAGE_HEADER + int.from_bytes(log[at : at + 2], "little")
        if key not in log[at : at + size]:
            kept.append(log[at : at + size])
        at += size
    return b"".join(kept)


def main() -> None:
    """Print a line for each flight."""
    for plan, options in FLIGHTS:
        print(fly(plan, options), plan, *(f"{name}={value}" for name, value in options.items()), flush=True)


if __name__ == "__main__":
    main()
