"""Land detector: ground contact and landing from motion, thrust and the descent setpoint.

The stages are those of PX4's MulticopterLandDetector:

* *Contact*: guidance descends and the thrust is much less than the weight, but the vehicle does not sink. It is then
  levelled with little thrust, so that a vehicle in the air falls and leaves the stage at once.
* *Rest* (PX4's "maybe landed"): contact has persisted. The loops stop, so that they do not wind up against the ground.
* *Landed*: no thrust and no fall for ``LANDED_S`` of rest.

Contact is found by the thrust setpoint, which is low on the ground even while wind or unstable loops shake the rotors.
The rotors may carry a vehicle against a low setpoint: with saturated loops, because roll and pitch have priority in the
mixer, or after a fault. Therefore landing needs rotors that do not carry the vehicle; with the loops stopped, only the
ground then prevents a fall.

Unlike PX4's, the detector ignores horizontal speed and rates: wind stronger than friction moves a vehicle along the
ground regardless of the rotors, and more thrust would only reduce the friction.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import VehicleState
from flightstack.params.vehicle import GRAVITY_M_S2

SUPPORT_LIFT = 0.7
"""Vertical thrust, as share of the weight, below which a vehicle sinks even if an updraft, a dropped payload or
stronger propellers compensate 0.3 of its weight."""
CONTACT_M_S = 1.0
"""Contact: sink rate that thrust below ``SUPPORT_LIFT`` would have caused in the air. In the air the sum stays below
0.5 m/s, the width of ``STILL_M_S``, for upward forces up to 0.3 of the weight; the rest allows for the rotors' lag."""
BOUNCE_SHARE = 0.5
"""Rate at which that sum decreases while the vehicle moves vertically, in g: a bounce does not clear it."""
BLOCKED_M_S = 10.0
"""After contact has ended in the air, the sum starts this far below 0: no contact for 2 s at ``BOUNCE_SHARE``."""
REST_M_S = 2.8
"""Value of that sum at which the loops stop: 0.3 s after contact, the time to level."""
CARRIED_M_S = 5.6
"""Value of that sum at which rotors that still carry the vehicle end contact: at least 0.4 s after their stop."""
DESCENT_M_S = 0.05
"""Least sink rate of the reference that counts as a descent, and least climb rate that counts as a climb."""
LANDED_S = 0.3
"""Time for which all landed conditions must hold at rest: a vehicle in the air falls faster than ``STANDING_M_S`` then,
also with an upward force of half the weight."""
LEVELLING_LIFT = 0.08
"""Thrust, as share of the weight, while levelling: little enough for friction, enough for yaw control."""
LANDED_LIFT = 0.15
"""Largest vertical thrust setpoint, as share of the weight, of a landed vehicle."""
STILL_M_S = 0.25
"""Largest vertical speed without climb or descent; PX4's LNDMC_Z_VEL_MAX."""
STANDING_M_S = 2.5 * STILL_M_S
"""The same for a vehicle that may vibrate on the ground; the factor is PX4's."""
SETTLING_M_S = 1.5
"""Vertical speed that ends contact; a tilted vehicle that settles from one foot onto the others stays below it."""
CLIMB_M = 0.15
"""Rise above the point of the last landing that ends it."""


class LandMemory(NamedTuple):
    """``landed`` is 0 or 1; ``ground_z_m`` is the down coordinate where the vehicle stands.

    ``missing_m_s`` is the sink rate that the thrust should have caused; ``stood_s`` counts from rest.
    """

    landed: float
    missing_m_s: float
    stood_s: float
    ground_z_m: float


@compiled
def lift_share(state: VehicleState, thrust_n: float, weight_n: float) -> float:
    """Return the vertical component of the thrust as share of the weight."""
    q = state.attitude
    return thrust_n * (1.0 - 2.0 * (q.x * q.x + q.y * q.y)) / weight_n


@compiled
def land_detector_step(
    memory: LandMemory, state: VehicleState, lift: float, rotor_lift: float, descent_m_s: float, dt_s: float
) -> LandMemory:
    """Advance the detector by ``dt_s``.

    ``lift`` is the ``lift_share`` of the thrust setpoint, ``rotor_lift`` that of the thrust at the rotors' speeds,
    ``descent_m_s`` the sink rate of the reference: infinite if guidance sets the thrust itself. Contact begins only in
    a descent. A rise by ``CLIMB_M`` ends the landed state.
    """
    vz, z = state.velocity_ned_m_s.z, state.position_ned_m.z
    if memory.landed > 0.0:
        if z < memory.ground_z_m - CLIMB_M:
            return LandMemory(0.0, 0.0, 0.0, z)
        return memory
    missing_m_s, change_m_s = memory.missing_m_s, (SUPPORT_LIFT - lift) * GRAVITY_M_S2 * dt_s
    if missing_m_s < CONTACT_M_S:
        decrease_m_s = BOUNCE_SHARE * GRAVITY_M_S2 * dt_s
        if missing_m_s < 0.0:
            missing_m_s = min(0.0, missing_m_s + decrease_m_s)
        elif descent_m_s < DESCENT_M_S:
            missing_m_s = 0.0
        elif abs(vz) >= min(STILL_M_S, 0.5 * descent_m_s):
            missing_m_s = max(0.0, missing_m_s - decrease_m_s)
        else:
            missing_m_s = max(0.0, missing_m_s + change_m_s)
        return LandMemory(0.0, missing_m_s, 0.0, z)
    is_carried = missing_m_s >= CARRIED_M_S and rotor_lift >= SUPPORT_LIFT
    if abs(vz) >= SETTLING_M_S or is_carried:
        return LandMemory(0.0, -BLOCKED_M_S, 0.0, z)
    if descent_m_s < -DESCENT_M_S or lift >= SUPPORT_LIFT:
        return LandMemory(0.0, 0.0, 0.0, z)
    has_no_thrust = lift < LANDED_LIFT and rotor_lift < SUPPORT_LIFT
    stands = missing_m_s >= REST_M_S and has_no_thrust and abs(vz) < STANDING_M_S
    stood_s = memory.stood_s + dt_s if stands else 0.0
    landed = 1.0 if stood_s >= LANDED_S - 1e-9 else 0.0
    return LandMemory(landed, missing_m_s + change_m_s, stood_s, z)
