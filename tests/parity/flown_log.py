"""Fly missions and print digests of their logs: run as a process under the settings of another processor.

``python -m tests.parity.flown_log PLAN`` prints a line for each library, the digest of what it computes here, which
shows whether the settings act; then one for each controller, the SHA-256 of its log. With NIGHTLY=1 it flies on the
estimated state too, whose kernels take half a minute to compile anew.
"""

from __future__ import annotations

import hashlib
import math
import sys
from collections.abc import Iterable

import numpy as np

from flightstack.params.config import ESTIMATED, TRUTH
from flightstack.testing import World
from tests.support.tools import NIGHTLY

FLIGHTS = [
    (controller, state)
    for state in ((TRUTH, ESTIMATED) if NIGHTLY else (TRUTH,))
    for controller in ("pid", "backstepping")
]
"""Controllers, and the states that they get."""


def digest(parts: Iterable[bytes]) -> str:
    return hashlib.sha256(b"".join(parts)).hexdigest()


def library_digests() -> dict[str, str]:
    """Digests of what libm, LAPACK and NumPy's own loops make of many inputs."""
    random = np.random.default_rng(5)
    values = random.uniform(-3.0, 3.0, 20_000)
    matrices = random.normal(size=(200, 4, 6))
    functions = (math.sin, math.cos, math.tan, math.exp, math.atan)
    return {
        "libm": digest(np.array([f(value) for value in values.tolist()]).tobytes() for f in functions),
        "lapack": digest(np.linalg.pinv(matrix).tobytes() for matrix in matrices),
        "numpy": digest(f(values).tobytes() for f in (np.sin, np.cos, np.exp, np.tanh)),
    }


def log_digest(plan: str, controller: str, state: str) -> str:
    """Digest of the log of a mission in wind, with gusts of wind and torque."""
    world = World(
        vehicle="x_quad",
        controller=controller,
        state=state,
        wind=(3.0, -1.0, 0.0),
        gust=1.0,
        torque_gust=0.002,
        seed=7,
    )
    world.upload(plan)
    world.arm()
    world.start_mission()
    world.run_until("not armed")
    return digest([world.flight().log.content])


def digests(plan: str) -> dict[str, str]:
    """Digests of the libraries and of each log, named ``controller-state``."""
    return library_digests() | {"-".join(flight): log_digest(plan, *flight) for flight in FLIGHTS}


if __name__ == "__main__":
    for name, made in digests(sys.argv[1]).items():
        print(name, made)
