"""Air near the ground: mean wind that grows with the height, and thrust that grows near the ground.

Mean wind by Hellmann's power law from the reference height of 10 m: W(h) = W · (h / 10 m)^p, p about 1/7 over open
land. With p = 0.14 it is within 4.2 % of the logarithmic profile of MIL-F-8785C (roughness 0.15 ft) between 5 m and
100 m. The height is at least 0.1 m.

Thrust by Cheeseman and Bennett (The effect of the ground on a helicopter rotor in forward flight, ARC R&M 3021, 1955),
at the same speed of the rotor: T / T∞ = 1 / (1 − (R / 4z)²), R the radius of the propeller, z the height of the
rotors, at least R / 2. One factor for all rotors, by their mean height: the difference between the rotors of a tilted
vehicle is left out, and so is the upwash between them.
"""

from __future__ import annotations

from flightstack.core.compiled import compiled
from flightstack.core.contract import Record, RecordArray
from flightstack.core.portable_math import distance, exp, log

REFERENCE_M = 10.0
LOWEST_M = 0.1
_LEAST_RADII = 0.5


@compiled
def wind_share(m: Record, z: float) -> float:
    """Return the share of the mean wind at a height, ``z`` NED [m] of the origin."""
    height = max(m["surface_z"] - z, LOWEST_M)
    share: float = exp(m["shear"] * log(height / REFERENCE_M))
    return share


@compiled
def airspeed(memory: RecordArray) -> float:
    """Return the airspeed [m/s] of a plant over the record ``MEMORY``, shape (1,)."""
    m = memory[0]
    x, wind, gust = m["body"], m["wind"], m["gust"]
    share = wind_share(m, x[2]) if m["alters_air"] != 0 else 1.0
    north, east = x[3] - share * wind[0] - gust[0], x[4] - share * wind[1] - gust[1]
    speed: float = distance(north, east, x[5] - share * wind[2] - gust[2])
    return speed


@compiled
def thrust_ratio(m: Record, z: float, down: float) -> float:
    """Return the thrust over that far from the ground; ``down`` is the component D of the body's z axis."""
    radius = m["propeller_radius"]
    if radius == 0.0:  # no ground effect
        return 1.0
    height = max(m["surface_z"] - z - down * m["rotor_z"], _LEAST_RADII * radius)
    share = radius / (4.0 * height)
    ratio: float = 1.0 / (1.0 - share * share)
    return ratio
