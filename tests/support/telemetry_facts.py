"""The facts of which telemetry messages are made, for tests: a vehicle in flight at a known state."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from flightstack.core.contract import LoopRow
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.modes import Mode
from flightstack.mavlink.dialect import FsLoopTiming
from flightstack.services.telemetry.facts import FenceBreaches, FlightTimes, NoBattery, PlanIds

HOME = GeoPoint(47.397742, 8.545594, 488.0)
EULER = (0.1, -0.2, 2.5)
X, Y, Z, W = Rotation.from_euler("ZYX", EULER[::-1]).as_quat()


def facts(**changes: object) -> SimpleNamespace:
    row = np.zeros(LoopRow.SIZE)
    row[LoopRow.REFERENCE_RATES] = 0.4, 0.5, 0.6
    row[LoopRow.WRENCH_ACHIEVED] = 6.0, 0.0, 0.0, 0.0
    row[LoopRow.ROTOR_SPEED] = [100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 0.0, 0.0]
    values = {
        "state": np.array([10.0, -20.0, -30.0, 1.0, -2.0, 0.5, W, X, Y, Z, 0.01, 0.02, 0.03]),
        "setpoint": np.arange(11.0),
        "attitude_target": np.array([1.0, 0.0, 0.0, 0.0, 5.0]),
        "row": row, "time_us": 12_345_678, "max_thrust_n": 12.0, "rotors": 4, "system_id": 1,
        "home": HOME, "frame": LocalFrame(HOME),
        "armed": True, "mode": Mode.MISSION, "landed": False, "climbing": False, "descending": False,
        "is_generic": False, "system_status": 4, "top_speed_rad_s": [600.0] * 4, "battery": NoBattery(),
        "flight": FlightTimes(), "plan_ids": PlanIds(), "fence_breached": False, "fence_acts": True,
        "mission_current": 2, "mission_count": 5, "mission_state": 3, "can_arm": True,
        "state_is_good": True, "battery_level": 0, "fence_breaches": FenceBreaches(),
        "loop_timing": lambda: FsLoopTiming(1, 2, 0, 0, 500.0, 100.0, 30.0, *[1.0] * 6, 0),
    }  # fmt: skip
    return SimpleNamespace(**{**values, **changes})
