"""MAV_CMD_INJECT_FAILURE: faults that a client requests in flight, as with PX4's simulators."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from flightstack.core.contract import Vector3
from flightstack.mavlink.dialect import mavlink
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.faults.schedule import Fault, Kind
from sim_bridge.simulator import Simulator

NEARLY_EMPTY = 0.03
"""Charge of a battery that is turned off: as in PX4 below each threshold, and enough for part of a minute."""

_SENSORS: Mapping[int, str] = MappingProxyType(
    {
        mavlink.FAILURE_UNIT_SENSOR_GYRO: "gyro",
        mavlink.FAILURE_UNIT_SENSOR_ACCEL: "accel",
        mavlink.FAILURE_UNIT_SENSOR_MAG: "mag",
        mavlink.FAILURE_UNIT_SENSOR_BARO: "baro",
        mavlink.FAILURE_UNIT_SENSOR_GPS: "gnss",
        mavlink.FAILURE_UNIT_SENSOR_OPTICAL_FLOW: "flow",
        mavlink.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR: "range",
    }
)
_WRONG: Mapping[str, Vector3] = MappingProxyType(
    {
        "gyro": Vector3(10.0, 10.0, 10.0),  # °/s
        "accel": Vector3(2.0, 2.0, 2.0),  # m/s²
        "mag": Vector3(0.2, 0.2, 0.2),  # gauss
        "baro": Vector3(5.0, 0.0, 0.0),  # hPa, 40 m
        "gnss": Vector3(30.0, 30.0, 0.0),  # m
        "range": Vector3(2.0, 0.0, 0.0),  # m
        "flow": Vector3(1.0, 1.0, 0.0),  # rad/s
    }
)
"""Bias of a wrong sensor; a sensor that sends garbage has ten times its largest component as noise."""
_LATE_S, _LOSS = 0.2, 0.5

_ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
_DENIED = int(mavlink.MAV_RESULT_DENIED)
_UNSUPPORTED = int(mavlink.MAV_RESULT_UNSUPPORTED)


def inject_failure(simulator: Simulator, unit: float, failure: float, instance: float) -> int:
    """Execute the command with its parameters 1 to 3, any numbers; return its MAV_RESULT.

    Motors: off, stuck at the present speed, slow (half of the thrust) or OK. Battery: off (nearly empty) or OK (full).
    Sensors: off, stuck, garbage, wrong, delayed (0.2 s), intermittent (half is lost) or OK. Instance 0 is all of them.
    A sensor is unsupported for a client that has not requested the sensors: it flies on the true state.
    """
    if unit == mavlink.FAILURE_UNIT_SYSTEM_MOTOR:
        return _fail_motor(simulator, failure, instance)
    if unit == mavlink.FAILURE_UNIT_SYSTEM_BATTERY:
        return _fail_battery(simulator, failure, instance)
    if unit in _SENSORS and simulator.sensors is not None:
        return _fail_sensor(simulator, _SENSORS[int(unit)], failure, instance)
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


def _fail_sensor(simulator: Simulator, name: str, failure: float, instance: float) -> int:
    if instance not in range(256):
        return _DENIED
    faults: dict[int, Callable[[str], Fault]] = {
        mavlink.FAILURE_TYPE_OFF: lambda sensor: Fault(Kind.SENSOR_OFF, sensor=sensor),
        mavlink.FAILURE_TYPE_STUCK: lambda sensor: Fault(Kind.SENSOR_FREEZE, sensor=sensor),
        mavlink.FAILURE_TYPE_GARBAGE: lambda sensor: Fault(
            Kind.SENSOR_NOISE, value=10.0 * max(_WRONG[name]), sensor=sensor
        ),
        mavlink.FAILURE_TYPE_WRONG: lambda sensor: Fault(
            Kind.SENSOR_BIAS, vector=_WRONG[name], sensor=sensor
        ),
        mavlink.FAILURE_TYPE_DELAYED: lambda sensor: Fault(Kind.SENSOR_LATE, value=_LATE_S, sensor=sensor),
        mavlink.FAILURE_TYPE_INTERMITTENT: lambda sensor: Fault(Kind.SENSOR_LOSS, value=_LOSS, sensor=sensor),
    }
    if failure != mavlink.FAILURE_TYPE_OK and failure not in faults:
        return _UNSUPPORTED
    is_inertial = name in ("gyro", "accel")
    if instance > 1 and not is_inertial:
        return _DENIED
    sensor = f"{name}{instance:.0f}" if is_inertial and instance else name
    try:
        simulator.check(Fault(Kind.SENSOR_OFF, sensor=sensor))
    except UsageProblemError:
        return _DENIED
    simulator.clear_sensor_faults(sensor)
    if failure in faults:
        simulator.inject(faults[int(failure)](sensor))
    return _ACCEPTED
