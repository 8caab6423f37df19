"""The simulator without I/O: one plant, its time, its faults, and the exchange of state and actuators.

The same vehicle, options, faults, seed and commands give the same bytes at any speed.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.core.geodesy import GeoPoint
from flightstack.core.periods import NEVER_US, next_due
from flightstack.mavlink.frames import HEADER_V2
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.battery_frame import BatteryReport, battery_buffer, encode_battery
from flightstack.simulator_link.hot_frames import (
    GROUND_CONTACT_FLAG,
    ActuatorsFrame,
    PlantStateFrame,
)
from sim_bridge.errors import PlantDivergedError
from sim_bridge.plant.battery import INTERVAL_US as BATTERY_INTERVAL_US
from sim_bridge.plant.battery import BatteryState, battery_report
from sim_bridge.plant.faults.checks import Flight, check_faults
from sim_bridge.plant.faults.effects import plant_faults
from sim_bridge.plant.faults.schedule import Schedule
from sim_bridge.plant.faults.table import ROWS, STATE_KINDS, Fault, Kind
from sim_bridge.plant.layout import CONTACT, DIVERGED, OUTPUT
from sim_bridge.plant.plant import Plant, PlantOptions
from sim_bridge.plants import make_plant
from sim_bridge.sensors.faults import without
from sim_bridge.sensors.suite import Sender, SensorSuite
from sim_bridge.sent_state import SentState

SIMULATOR_COMPONENT = 200
DEFAULT_INTERVAL_US = 2000
SHORTEST_INTERVAL_US = 50
LONGEST_INTERVAL_US = 1_000_000
SLOWEST_PHYSICS_HZ = 100.0
FASTEST_PHYSICS_HZ = 100_000.0

_STATE_AT = HEADER_V2 + 8  # after the time
_FLAGS = (0, GROUND_CONTACT_FLAG)
_NEVER_US = 1 << 64


class Simulator:
    """Advances a plant by one exchange interval for each set of actuator commands."""

    def __init__(
        self,
        vehicle: Vehicle,
        plant: str = "rigid",
        options: PlantOptions | None = None,
        *,
        physics_hz: float = 1000.0,
        interval_us: int = DEFAULT_INTERVAL_US,
        system_id: int = 1,
    ) -> None:
        self.vehicle = vehicle
        self._flight = Flight(vehicle, plant, options or PlantOptions())
        self.plant: Plant = make_plant(*self._flight[:3])
        self.time_us = 0
        self._physics_dt_us = 1e6 / physics_hz
        self._frame = PlantStateFrame(system_id, SIMULATOR_COMPONENT)
        self._frame.set_rotor_count(len(vehicle.rotors))
        self.plant.output = np.frombuffer(self._frame.frame, OUTPUT, 1, _STATE_AT)
        self._flags = 0
        self.battery_buffer = battery_buffer(system_id, SIMULATOR_COMPONENT)
        """Frame of BATTERY_STATUS with the newest sequence number, which compiled code completes."""
        self.battery_due_us = np.full(1, NEVER_US if self.plant.battery is None else 0)
        """Time of the next report of the battery [µs], which a kernel that notes it moves on."""
        self._battery_due = self.battery_due_us.data  # a number of an array takes four times as long to read
        self._schedule = Schedule()
        self._change_us = _NEVER_US  # of the next work of ``apply`` for faults
        self._fault_us = _NEVER_US  # of the next begin or end of a fault
        self._sent: SentState | None = None  # instead of the true state
        self.sensors: SensorSuite | None = None
        """The sensors, from ``start_sensors`` on."""
        self.drops_state = False
        self._system_id = system_id
        self.set_interval_us(interval_us)
        self._set_flags(self.plant.show())

    @property
    def interval_us(self) -> int:
        """Simulated time between two exchanges [µs]."""
        return self._interval_us

    @property
    def on_ground(self) -> bool:
        """True if the vehicle touches the ground."""
        return self._flags != 0

    def set_interval_us(self, interval_us: int) -> None:
        """Set the exchange interval, which is split into equal steps no longer than a physics step."""
        if not SHORTEST_INTERVAL_US <= interval_us <= LONGEST_INTERVAL_US:
            raise ValueError(f"an interval of {interval_us} µs is outside the allowed 50 µs to 1 s")
        self._interval_us = interval_us
        self._steps = max(1, math.ceil(interval_us / self._physics_dt_us - 1e-9))
        self.plant.set_step(interval_us * 1e-6 / self._steps)
        if self.sensors is not None:
            self.sensors.set_interval_us(interval_us)

    def start_sensors(self, home: GeoPoint) -> bool:
        """Measure with the sensors of the vehicle from now on; return False if it has none. ``home`` is the origin."""
        if self.sensors is None and self.vehicle.sensors.numbers:
            sender = Sender(self._system_id, SIMULATOR_COMPONENT)
            options = self._flight.options
            self.sensors = SensorSuite(self.vehicle, home, options, self._frame, self.plant, sender)
            self.sensors.set_interval_us(self._interval_us)
            self.sensors.prime(self.time_us)
            self.sensors.set_faults(self._schedule.active(self.time_us), self.time_us)
            self.sensors.measure(self.time_us)
        return self.sensors is not None

    def stop_sensors(self) -> None:
        """Measure no longer."""
        self.sensors = None

    def outgoing(self) -> bytes | memoryview:
        """Return the bytes to send for the present state, valid until the next call of ``apply``.

        FS_PLANT_STATE, preceded by BATTERY_STATUS twice a second and followed by the messages of the sensors.
        ``state:drop`` drops FS_PLANT_STATE.
        """
        truth = self._outgoing_truth()
        return truth if self.sensors is None else bytes(truth) + self.sensors.frames(self.stamp_us)

    def _outgoing_truth(self) -> bytes | memoryview:
        if self.time_us < self._battery_due[0] and not self.drops_state:
            return self.state_frame()
        battery = self.battery_frame()
        return battery if self.drops_state else battery + self.state_frame()

    def state_frame(self) -> memoryview:
        """Return the FS_PLANT_STATE frame of the present state, valid until the next call of ``apply``."""
        if self._sent is not None:
            return self._sent.seal(self.time_us, self._flags)
        return self._frame.seal(self.time_us, self._flags)

    def battery_frame(self) -> bytes:
        """Return the BATTERY_STATUS frame if one is due, else no bytes."""
        battery = self.plant.battery
        if self.time_us < self._battery_due[0] or battery is None or self.vehicle.battery is None:
            return b""
        self._battery_due[0] = next_due(self.time_us, BATTERY_INTERVAL_US)
        report = self.battery_report(battery)
        return encode_battery(report, self.battery_buffer[4], self._system_id, SIMULATOR_COMPONENT)

    def battery_report(self, battery: BatteryState) -> BatteryReport:
        """Return the next report, of a vehicle with this battery."""
        assert self.vehicle.battery is not None
        self.battery_buffer[4] = (self.battery_buffer[4] + 1) & 255
        return battery_report(battery, self.vehicle.battery.cells)

    @property
    def frame(self) -> PlantStateFrame:
        """The true state; read only."""
        return self._frame

    @property
    def shown(self) -> PlantStateFrame:
        """The state as sent, with its faults; read only."""
        return self._frame if self._sent is None else self._sent.frame

    @property
    def stamp_us(self) -> int:
        """Time stamp of the state as sent [µs]: ``time_us``, but for faults of the clock."""
        return self.time_us if self._sent is None else self._sent.stamp_us(self.time_us)

    # ------------------------------------------------------------------ faults

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Active and scheduled faults."""
        return tuple(self._schedule.faults)

    def inject(self, *faults: Fault) -> None:
        """Schedule faults; one in the past begins at once. If two faults affect the same part, the last one wins.

        Raises UsageProblemError for a fault that cannot act, and schedules none then.
        """
        check_faults(faults, self._flight._replace(faults=self.faults))
        for fault in faults:
            counts = ROWS[fault.kind].is_event or fault.kind is Kind.SENSOR_DRIFT  # from its begin
            is_late = counts and fault.begin_us < self.time_us
            self._schedule.faults.append(fault._replace(begin_us=self.time_us) if is_late else fault)
        self._update_faults()

    def check(self, fault: Fault) -> None:
        """Raise UsageProblemError for a fault that cannot act."""
        check_faults((fault,), self._flight._replace(faults=self.faults))

    def clear_sensor_faults(self, sensor: str) -> None:
        """End the active faults of a sensor, as "mag" or "gyro2"; "gyro" is that of all inertial sensors.

        A fault of several sensors, as "imu", stays on the other ones.
        """
        count = self.vehicle.sensors.imu_count
        self._schedule.faults = [
            left
            for fault in self._schedule.faults
            for left in ([fault] if fault.begin_us > self.time_us else without(fault, sensor, count))
        ]
        self._update_faults()

    def clear_faults(self, rotor: int | None = None, part: str | None = None) -> None:
        """Remove all faults, scheduled ones too; with ``rotor`` (from 0) or ``part``, the active ones of this part.

        ``part`` is a first word of the compact notation, such as "payload". Charge and time stamps stay as they are.
        """
        self._schedule.faults = [
            fault
            for fault in self._schedule.faults
            if (rotor is not None or part is not None)
            and (
                fault.begin_us > self.time_us
                or rotor not in (None, fault.rotor)
                or part not in (None, ROWS[fault.kind].part)
            )
        ]
        self._update_faults()

    def _update_faults(self) -> None:
        """Apply the active faults, and find the time of the next change."""
        schedule, now_us = self._schedule, self.time_us
        events = schedule.take_due_events(now_us)
        active = schedule.active(now_us)
        self.plant.set_faults(plant_faults(active))
        if self.sensors is not None:
            self.sensors.set_faults(active, now_us)
        for event in events:
            if event.kind is Kind.BATTERY_LEVEL:
                self.plant.set_charge(event.value)
                self._battery_due[0] = now_us  # report the change at once
        self._set_sent_state(active, [event for event in events if event.kind is Kind.CLOCK_JUMP])
        schedule.remove_past(now_us)
        change_us = schedule.next_change_us(now_us)
        self._fault_us = _NEVER_US if change_us is None else change_us
        self._change_us = 0 if self._sent is not None and self._sent.is_late else self._fault_us

    def _set_sent_state(self, active: list[Fault], jumps: list[Fault]) -> None:
        """Select the state that is sent from now on, and its time stamp."""
        last = next((fault for fault in reversed(active) if fault.kind in STATE_KINDS), None)
        stalls = any(fault.kind is Kind.CLOCK_STALL for fault in active)
        if self._sent is None:
            if last is None and not stalls and not jumps:
                return
            self._sent = SentState(self._frame, PlantStateFrame(self._system_id, SIMULATOR_COMPONENT))
        self._sent.stall(stalls, self.time_us)
        for jump in jumps:
            self._sent.jump(jump.value, self.time_us)
        self._sent.select(last, self.time_us, self._flags)
        self.drops_state = self._sent.is_dropped
        if self._sent.is_true:
            self._sent = None

    # ------------------------------------------------------------------ time

    def apply(self, actuators: ActuatorsFrame) -> None:
        """Advance by one interval with the commands held; raise PlantDivergedError."""
        result = self.plant.advance(actuators.rotor_speed_rad_s, actuators.flags, self._steps)
        self.time_us += self._interval_us
        if result > CONTACT:
            self._set_flags(result)
        self._flags = _FLAGS[result]
        if self.time_us >= self._change_us:
            self._follow_faults()
        if self.sensors is not None:
            self.sensors.measure(self.time_us)

    @property
    def steps(self) -> int:
        """Steps of the plant in an interval."""
        return self._steps

    def pass_by(self, count: int, result: int, fields: int) -> None:
        """Count quiet intervals that the plant's kernel advanced, with the bits of the last one; raise as ``apply``.

        ``fields`` are the bits of HIL_SENSOR for sensors that are not inertial.
        """
        self.time_us += count * self._interval_us
        self._set_flags(result)
        if self.sensors is not None:
            self.sensors.pass_by(count, fields)

    @property
    def sends_state_alone(self) -> bool:
        """True if ``outgoing`` has the true state and, with sensors, messages of sensors, but nothing else."""
        return self._sent is None and self.time_us < self._battery_due[0]

    def quiet_intervals(self, measures: bool, fixes: bool = True, reports: bool = False) -> int:
        """Return how many of the next intervals change nothing but the state and the inertial sensors.

        The bytes after each of them are FS_PLANT_STATE and, with sensors, HIL_SENSOR. With ``measures``, magnetometer
        and barometer may change too, and with ``fixes`` the GNSS receiver: HIL_GPS precedes HIL_SENSOR. With
        ``reports``, the battery may be due.
        """
        sensors = self.sensors
        if self._sent is not None or not (sensors is None or sensors.is_quiet):
            return 0
        due_us = self._change_us if reports else min(self._change_us, self._battery_due[0])
        if sensors is not None:
            due_us = min(due_us, sensors.next_other_us if measures else sensors.next_us)
            if not fixes:
                due_us = min(due_us, sensors.next_fix_us)
        return max(0, (due_us - 1 - self.time_us) // self._interval_us)

    def _follow_faults(self) -> None:
        """Begin and end faults that are due, and follow the true state with a late one."""
        if self.time_us >= self._fault_us:
            self._update_faults()
        elif self._sent is not None:
            self._sent.update(self.time_us, self._flags)

    def _set_flags(self, result: int) -> None:
        if result & DIVERGED:
            raise PlantDivergedError(
                f"the plant diverged at t={self.time_us * 1e-6:.3f} s: forces or rates are too large for the "
                "step; use a higher --physics-hz or smaller commands"
            )
        self._flags = _FLAGS[result]
