"""Conditions under which a fault acts: a fault that cannot act is refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from flightstack.core.contract import Vector3
from flightstack.params.vehicle import NO_DRAG_PLANT, Vehicle
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.faults.table import NO_END, ROWS, STATE_KINDS, Fault, Kind, Need
from sim_bridge.plant.plant import PlantOptions

_STILL = Vector3(0.0, 0.0, 0.0)
_OTHER_PLANTS = "use --plant rigid or multibody"


class Flight(NamedTuple):
    """Parts of the simulator that faults act on."""

    vehicle: Vehicle
    plant: str
    options: PlantOptions
    faults: Sequence[Fault] = ()  # of the flight, before the checked ones


class Client(NamedTuple):
    """Messages that a flight stack flies on, and its clock."""

    wants_sensors: bool
    has_sensors: bool
    """It also gets the sensors if it wants the standard state."""
    in_lockstep: bool


def _battery(flight: Flight) -> str | None:
    has_battery = flight.vehicle.battery is not None and flight.options.battery is not None
    return None if has_battery else f"the vehicle {flight.vehicle.name} has no [battery]"


def _cells(flight: Flight) -> str | None:
    battery = flight.vehicle.battery
    if battery is None or battery.cells > 1:
        return None
    return f"the battery of the vehicle {flight.vehicle.name} has one cell; use battery level 0"


def _drag(flight: Flight) -> str | None:
    return flight.vehicle.wind_refusal(flight.plant)


def _mean_wind(flight: Flight) -> str | None:
    if flight.options.boat_ned_m_s != _STILL:
        return "the wind on a boat does not change with the height"
    has_step = any(fault.kind is Kind.WIND_STEP for fault in flight.faults)
    if has_step or flight.options.disturbance.wind_ned_m_s != _STILL:
        return None
    return "there is no mean wind to change with the height; give a wind, or a wind step before it"


def _mass(flight: Flight) -> str | None:
    if flight.plant != NO_DRAG_PLANT:
        return None
    return f"the paper's model has its centre of gravity in the origin; {_OTHER_PLANTS}"


def _payload(flight: Flight) -> str | None:
    has_payload = any(fault.kind is Kind.PAYLOAD for fault in flight.faults)
    return None if has_payload else "there is no payload to cut"


def _ground(flight: Flight) -> str | None:
    if flight.plant == NO_DRAG_PLANT:
        return f"the paper's model has no ground effect; {_OTHER_PLANTS}"
    return None if flight.options.ground else "there is no ground"


def _sensor(fault: Fault, flight: Flight) -> str | None:
    name, number = fault.sensor.rstrip("0123456789"), fault.sensor.lstrip("abcdefghijklmnopqrstuvwxyz")
    is_imu = name in ("imu", "gyro", "accel")
    sensors = flight.vehicle.sensors
    if ("imu" if is_imu else name) not in sensors.numbers:
        return f"the vehicle {flight.vehicle.name} has no such sensor"
    if is_imu and number and int(number) > sensors.imu_count:
        return f"the vehicle {flight.vehicle.name} has inertial sensors 1 to {sensors.imu_count}"
    if fault.kind is Kind.VIBRATION and not sensors.numbers["imu"]["rotor_imbalance_g_mm"]:
        return f"the rotors of the vehicle {flight.vehicle.name} have no imbalance; set rotor_imbalance_g_mm"
    return None


_REASONS: Mapping[Need, Callable[[Flight], str | None]] = MappingProxyType(
    {
        Need.BATTERY: _battery,
        Need.CELLS: _cells,
        Need.DRAG: _drag,
        Need.MEAN_WIND: _mean_wind,
        Need.MASS: _mass,
        Need.PAYLOAD: _payload,
        Need.GROUND: _ground,
    }
)


def check_faults(faults: Sequence[Fault], flight: Flight, names: Sequence[str] = ()) -> None:
    """Raise UsageProblemError for a fault that cannot act; ``names`` are those of the faults for the sentence."""
    flight = flight._replace(faults=(*flight.faults, *faults))
    for index, fault in enumerate(faults):
        reason = _refusal(fault, flight)
        if reason is not None:
            raise UsageProblemError(
                f"{names[index] if names else f'fault {ROWS[fault.kind].words}'}: {reason}"
            )


def _refusal(fault: Fault, flight: Flight) -> str | None:
    """Return why a fault cannot act, or None."""
    row = ROWS[fault.kind]
    if row.is_event and fault.end_us is not None:
        return NO_END
    if Need.SENSOR in row.needs:
        return _sensor(fault, flight)
    return next((reason for need in row.needs if (reason := _REASONS[need](flight)) is not None), None)


def client_refusal(faults: Sequence[Fault], client: Client) -> str | None:
    """Return why one of the faults cannot act on a flight stack, or None."""
    sensor = next((fault.sensor for fault in faults if fault.sensor), None)
    if sensor is not None and not client.has_sensors:
        return (
            f"the fault of the sensor {sensor} cannot act: the flight stack flies on the true state; start it "
            "with --state estimated"
        )
    state = next((fault.kind for fault in faults if fault.kind in STATE_KINDS), None)
    if state is not None and client.wants_sensors:
        return (
            f"{ROWS[state].compact.partition('=')[0]} cannot act: the flight stack flies on its sensors; start it "
            "with --state truth, or use a fault of a sensor, such as sensor:imu:freeze"
        )
    if client.in_lockstep and any(fault.kind is Kind.STATE_DROP for fault in faults):
        return (
            "state:drop needs a flight stack on its own clock (--clock realtime): in lockstep both sides "
            "would wait for ever; use state:freeze or state:nan"
        )
    return None
