"""MAV_CMD_INJECT_FAILURE: faults that a client requests in flight, as with PX4's simulators."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from sim_bridge.plant.fault_schedule import Fault, Kind
from sim_bridge.simulator import Simulator

NEARLY_EMPTY = 0.03
"""Charge of a battery that is turned off: as in PX4 below each threshold, and enough for part of a minute."""

_ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
_DENIED = int(mavlink.MAV_RESULT_DENIED)
_UNSUPPORTED = int(mavlink.MAV_RESULT_UNSUPPORTED)


def inject_failure(simulator: Simulator, unit: float, failure: float, instance: float) -> int:
    """Execute the command with its parameters 1 to 3, any numbers; return its MAV_RESULT.

    Motors: off, stuck at the present speed, slow (half of the thrust) or OK; instance 0 is all motors. Battery: off
    (nearly empty) or OK (full).
    """
    if unit == mavlink.FAILURE_UNIT_SYSTEM_MOTOR:
        return _fail_motor(simulator, failure, instance)
    if unit == mavlink.FAILURE_UNIT_SYSTEM_BATTERY:
        return _fail_battery(simulator, failure, instance)
    return _UNSUPPORTED


def _fail_motor(simulator: Simulator, failure: float, instance: float) -> int:
    count = len(simulator.vehicle.rotors)
    if instance not in range(count + 1):
        return _DENIED
    faults = {
        mavlink.FAILURE_TYPE_OFF: lambda rotor: Fault(Kind.ROTOR_OFF, rotor),
        mavlink.FAILURE_TYPE_STUCK: lambda rotor: Fault(
            Kind.ROTOR_STUCK, rotor, float(simulator.frame.rotor_speed_rad_s[rotor])
        ),
        mavlink.FAILURE_TYPE_SLOW: lambda rotor: Fault(Kind.ROTOR_WEAK, rotor, 0.5),
    }
    if failure != mavlink.FAILURE_TYPE_OK and failure not in faults:
        return _UNSUPPORTED
    for rotor in range(count):
        if instance in (0, rotor + 1):
            simulator.clear_faults(rotor)
            if failure in faults:
                simulator.inject(faults[int(failure)](rotor))
    return _ACCEPTED


def _fail_battery(simulator: Simulator, failure: float, instance: float) -> int:
    if simulator.plant.battery is None or instance not in (0, 1):
        return _DENIED
    if failure not in (mavlink.FAILURE_TYPE_OFF, mavlink.FAILURE_TYPE_OK):
        return _UNSUPPORTED
    level = NEARLY_EMPTY if failure == mavlink.FAILURE_TYPE_OFF else 1.0
    simulator.inject(Fault(Kind.BATTERY_LEVEL, value=level))
    return _ACCEPTED
