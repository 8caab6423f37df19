"""Decide whether the vehicle stands on the ground, from motion and thrust alone."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.compiled import compiled
from flightstack.contract import VehicleState

SETTLE_S = 0.6
"""How long all signs must agree before the vehicle counts as landed."""
CONTACT_S = 0.1
"""How long they must agree before it counts as touching the ground. In the air they cannot: it would be falling."""
CONTACT_THRUST = 0.3
"""Thrust on touching the ground, as share of the weight."""
CLIMB_M = 0.15
"""Rise above the point of the last landing that ends it."""


class LandMemory(NamedTuple):
    """``landed`` is 0 or 1; ``ground_z_m`` is the down coordinate where the vehicle stands."""

    landed: float
    settled_s: float
    ground_z_m: float


@compiled
def land_detector_step(
    memory: LandMemory, state: VehicleState, thrust_n: float, weight_n: float, descending: bool, dt_s: float
) -> LandMemory:
    """Advance the detector.

    Landed needs, for ``SETTLE_S``: told to descend, yet hardly moving, and held up by something other than
    the rotors (thrust below 0.75 of the weight). It ends when the vehicle has risen by ``CLIMB_M``.
    """
    v = state.velocity_ned_m_s
    z = state.position_ned_m.z
    if memory.landed > 0.0:
        if z < memory.ground_z_m - CLIMB_M:
            return LandMemory(0.0, 0.0, z)
        return memory
    sinking = (
        0.5 if memory.settled_s >= CONTACT_S else 0.2
    )  # a tilted vehicle levels with one foot on the ground
    still = abs(v.z) < sinking and v.x * v.x + v.y * v.y < 0.16
    if not (descending and still and thrust_n < 0.75 * weight_n):
        return LandMemory(0.0, 0.0, z)
    settled_s = memory.settled_s + dt_s
    return LandMemory(1.0 if settled_s >= SETTLE_S else 0.0, settled_s, z)
