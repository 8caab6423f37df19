"""The standard HIL messages, for third parties: HIL_STATE_QUATERNION out, HIL_ACTUATOR_CONTROLS in.

Accelerations follow the MAVLink specification: specific force, body FRD, in thousandths of standard gravity (level at
rest: z = −1000). PX4 reads these fields in thousandths of m/s², as jMAVSim and Gazebo send them, and must scale ours
by 9.80665. PX4 only logs them as ground truth.
"""

from __future__ import annotations

import math
from typing import Any

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.core.geometry import conjugate, rotate
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import int16, int32, whole
from flightstack.mavlink.link import Message
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG, LOCKSTEP_FLAG, ActuatorsFrame
from sim_bridge.simulator import Simulator

STANDARD_GRAVITY_M_S2 = 9.80665
HIL_LOCKSTEP_FLAG = 1  # HIL_ACTUATOR_CONTROLS_FLAGS_LOCKSTEP
_HIL_ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def hil_state(simulator: Simulator, frame: LocalFrame) -> Message:
    """Return HIL_STATE_QUATERNION of the present state, positions relative to the origin of ``frame``."""
    shown = simulator.shown.state.tolist()
    # integer fields have no NaN: only attitude and rates show it
    x = shown if all(map(math.isfinite, shown)) else simulator.frame.state.tolist()
    velocity, attitude = x[3:6], Quaternion(*x[6:10])
    geo = frame.to_geo(Vector3(*x[0:3]))
    a = simulator.plant.acceleration_ned_m_s2()
    force = rotate(conjugate(attitude), Vector3(a.x, a.y, a.z - GRAVITY_M_S2))
    airspeed = whole(simulator.plant.airspeed_m_s() * 100.0, 0, 65535)
    return mavlink.MAVLink_hil_state_quaternion_message(
        simulator.stamp_us,
        shown[6:10],
        *shown[10:13],
        int32(geo.latitude_deg * 1e7),
        int32(geo.longitude_deg * 1e7),
        int32(geo.altitude_m * 1e3),
        *(int16(v * 100.0) for v in velocity),
        airspeed,
        airspeed,
        *(int16(f / STANDARD_GRAVITY_M_S2 * 1000.0) for f in force),
    )


class HilControls:
    """Converts HIL_ACTUATOR_CONTROLS to rotor speeds: a control, 0 to 1, is a share of full thrust.

    ``vehicle`` has its rotor limits, which define full thrust, also with ideal rotors.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._full_speed = tuple(rotor.max_speed_rad_s for rotor in vehicle.rotors)

    def write(self, message: Any, actuators: ActuatorsFrame) -> None:
        """Write commands, time and flags of ``message`` to ``actuators``.

        NaN is passed on: the plant then holds the last good command.
        """
        for index, full in enumerate(self._full_speed):
            control = message.controls[index]
            share = control if math.isnan(control) else min(max(control, 0.0), 1.0)
            actuators.rotor_speed_rad_s[index] = full * math.sqrt(share)
        flags = ARMED_FLAG if message.mode & _HIL_ARMED else 0
        flags |= LOCKSTEP_FLAG if message.flags & HIL_LOCKSTEP_FLAG else 0
        actuators.set_rotor_count(len(self._full_speed))
        actuators.seal(message.time_usec, flags)
