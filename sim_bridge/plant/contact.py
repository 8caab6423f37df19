"""Contact of one point with flat ground, in compiled code.

Normal force: spring and damper, the damping growing with the depth up to ``ramp`` so that the force is
continuous at touchdown; never adhesive. Friction: a spring and damper to an anchor on the ground, limited to
μ·N (Coulomb). When the limit is reached the anchor slips along, once a step. So a vehicle at rest stays where
it is under any force below the limit, without the creep of a friction law regularised in velocity alone
(Cundall and Strack, Géotechnique 29, 1979).
"""

from __future__ import annotations

import math

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Vector3

FRICTION = 0.7


@compiled
def normal_force(depth_m: float, sink_m_s: float, stiffness: float, damping: float, ramp_m: float) -> float:
    """Upward force [N] on a point ``depth_m`` in the ground that sinks with ``sink_m_s``."""
    if depth_m <= 0.0:
        return 0.0
    return max(0.0, stiffness * depth_m + damping * min(1.0, depth_m / ramp_m) * sink_m_s)


@compiled
def limited(value: float, limit: float) -> float:
    """Clip to ±limit."""
    return min(max(value, -limit), limit)


@compiled
def contact_force(
    position: Vector3,
    velocity: Vector3,
    anchor: FloatArray,
    normal_n: float,
    stiffness: float,
    damping: float,
) -> Vector3:
    """Force NED [N] on a point that presses with ``normal_n``; position [m] and velocity [m/s] NED."""
    fx = -stiffness * (position.x - anchor[0]) - damping * velocity.x
    fy = -stiffness * (position.y - anchor[1]) - damping * velocity.y
    size = math.sqrt(fx * fx + fy * fy)
    limit = FRICTION * normal_n
    if size > limit:
        fx, fy = fx * limit / size, fy * limit / size
    return Vector3(fx, fy, -normal_n)


@compiled
def move_anchor(anchor: FloatArray, x: float, y: float, normal_n: float, stiffness: float) -> None:
    """Let the anchor slip until its spring holds no more than friction allows; without load it follows."""
    dx, dy = x - anchor[0], y - anchor[1]
    stretch = math.sqrt(dx * dx + dy * dy)
    largest = FRICTION * normal_n / stiffness
    if stretch > largest:
        keep = largest / stretch
        anchor[0], anchor[1] = x - dx * keep, y - dy * keep
