"""Decide whether the vehicle stands on the ground, from motion, thrust and what guidance asks for.

The stages are those of PX4's MulticopterLandDetector:

* *Contact*: guidance asks for a descent, the thrust carries less than the weight, and yet the vehicle does not sink. It
  is then levelled with hardly any thrust, so that a vehicle that touches nothing falls, and leaves the stage at once.
* *Rest* (PX4's "maybe landed"): contact has lasted. The loops stop, so that nothing works against the ground.
* *Landed*: since contact the vehicle has neither had thrust nor fallen for a while.

Unlike PX4's, the detector looks at no horizontal speed and no rates: wind that is stronger than friction makes a
vehicle slide and rattle along the ground whatever the rotors do, and their thrust would only help it.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.compiled import compiled
from flightstack.contract import VehicleState
from flightstack.params.vehicle import GRAVITY_M_S2

CONTACT_M_S = 1.0
"""Sink rate that the missing thrust should have led to, and has not: contact. In the air it is 0.5 m/s at most, the
width of ``STILL_M_S``; the rest is for what an updraft carries."""
BOUNCE_SHARE = 0.5
"""How fast that sum falls again while the vehicle is not still, in g: a bounce on its feet does not clear it."""
REST_M_S = 4.0
"""The same from which on the vehicle rests without any control: 0.3 s after contact, in which it has levelled."""
LANDED_S = 0.4
"""How long the signs of standing must agree after contact."""
CONTACT_LIFT = 0.9
"""Vertical thrust, as share of the weight, below which something else must carry a vehicle that does not sink."""
LEVELLING_LIFT = 0.08
"""Thrust, as share of the weight, of a vehicle that is levelled: friction holds it, and yaw is controlled."""
LANDED_LIFT = 0.15
"""Vertical thrust, as share of the weight, of a vehicle that stands."""
STILL_M_S = 0.25
"""Vertical speed of a vehicle that neither climbs nor sinks; PX4's LNDMC_Z_VEL_MAX."""
STANDING_M_S = 2.5 * STILL_M_S
"""The same for a vehicle that may rattle on the ground; the factor is PX4's."""
SETTLING_M_S = 1.5
"""Vertical speed that ends contact: a tilted vehicle with one foot on the ground falls onto the others."""
CLIMB_M = 0.15
"""Rise above the point of the last landing that ends it."""


class LandMemory(NamedTuple):
    """``landed`` is 0 or 1; ``ground_z_m`` is the down coordinate where the vehicle stands.

    ``missing_m_s`` is the sink rate that has not come; ``stood_s`` counts from contact.
    """

    landed: float
    missing_m_s: float
    stood_s: float
    ground_z_m: float


@compiled
def lift_share(state: VehicleState, thrust_n: float, weight_n: float) -> float:
    """Return the vertical part of the thrust as share of the weight."""
    q = state.attitude
    return thrust_n * (1.0 - 2.0 * (q.x * q.x + q.y * q.y)) / weight_n


@compiled
def land_detector_step(
    memory: LandMemory, state: VehicleState, lift: float, descent_m_s: float, dt_s: float
) -> LandMemory:
    """Advance the detector by ``dt_s``.

    ``lift`` is the ``lift_share`` of the thrust asked for, ``descent_m_s`` the sink rate that guidance asks for:
    infinite for "as the thrust leads to", 0 or less for none. A landing ends with a rise by ``CLIMB_M``.
    """
    vz, z = state.velocity_ned_m_s.z, state.position_ned_m.z
    if memory.landed > 0.0:
        if z < memory.ground_z_m - CLIMB_M:
            return LandMemory(0.0, 0.0, 0.0, z)
        return memory
    if not (descent_m_s > 0.0 and lift < CONTACT_LIFT):
        return LandMemory(0.0, 0.0, 0.0, z)
    missing_m_s = memory.missing_m_s + (1.0 - lift) * GRAVITY_M_S2 * dt_s
    if memory.missing_m_s < CONTACT_M_S:
        if abs(vz) >= min(STILL_M_S, 0.5 * descent_m_s):
            missing_m_s = max(0.0, memory.missing_m_s - BOUNCE_SHARE * GRAVITY_M_S2 * dt_s)
        return LandMemory(0.0, missing_m_s, 0.0, z)
    if abs(vz) >= SETTLING_M_S:
        return LandMemory(0.0, 0.0, 0.0, z)
    stands = lift < LANDED_LIFT and abs(vz) < STANDING_M_S
    stood_s = memory.stood_s + dt_s if stands else 0.0
    return LandMemory(1.0 if stood_s >= LANDED_S - 1e-9 else 0.0, missing_m_s, stood_s, z)
