"""The simulator without I/O: one plant, its time, its faults, and the exchange of state and actuators.

The same vehicle, options, faults, seed and commands give the same bytes at any speed.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.mavlink.frames import HEADER_V2
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.battery_frame import encode_battery
from flightstack.simulator_link.hot_frames import (
    GROUND_CONTACT_FLAG,
    ActuatorsFrame,
    PlantStateFrame,
)
from sim_bridge.errors import PlantDivergedError
from sim_bridge.plant.battery import INTERVAL_US as BATTERY_INTERVAL_US
from sim_bridge.plant.battery import battery_report
from sim_bridge.plant.faults import Fault, Kind, Schedule
from sim_bridge.plant.layout import CONTACT, DIVERGED, OUTPUT
from sim_bridge.plant.plant import Plant, PlantOptions
from sim_bridge.plants import make_plant

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
        self.plant: Plant = make_plant(vehicle, plant, options or PlantOptions())
        self.time_us = 0
        self._physics_dt_us = 1e6 / physics_hz
        self._frame = PlantStateFrame(system_id, SIMULATOR_COMPONENT)
        self._frame.set_rotor_count(len(vehicle.rotors))
        self.plant.output = np.frombuffer(self._frame.frame, OUTPUT, 1, _STATE_AT)
        self._flags = 0
        self._battery_seq = 0
        self._battery_due_us = _NEVER_US if self.plant.battery is None else 0
        self._schedule = Schedule()
        self._change_us = _NEVER_US
        self._faulty: PlantStateFrame | None = None  # sent instead of the state during a fault
        self._faulty_flags = 0
        self.drops_state = False
        self._state_fault: Kind | None = None
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

    def outgoing(self) -> bytes | memoryview:
        """Return the bytes to send for the present state, valid until the next call of ``apply``.

        FS_PLANT_STATE, preceded by BATTERY_STATUS ten times a second. ``state:drop`` drops FS_PLANT_STATE.
        """
        if self.time_us < self._battery_due_us and not self.drops_state:
            return self.state_frame()
        battery = self.battery_frame()
        return battery if self.drops_state else battery + self.state_frame()

    def state_frame(self) -> memoryview:
        """Return the FS_PLANT_STATE frame of the present state, valid until the next call of ``apply``."""
        if self._faulty is not None:
            return self._faulty.seal(self.time_us, self._faulty_flags)
        return self._frame.seal(self.time_us, self._flags)

    def battery_frame(self) -> bytes:
        """Return the BATTERY_STATUS frame if one is due, else no bytes."""
        battery = self.plant.battery
        if self.time_us < self._battery_due_us or battery is None or self.vehicle.battery is None:
            return b""
        self._battery_due_us = (self.time_us // BATTERY_INTERVAL_US + 1) * BATTERY_INTERVAL_US
        report = battery_report(battery, self.vehicle.battery.cells)
        seq, self._battery_seq = self._battery_seq, (self._battery_seq + 1) & 255
        return encode_battery(report, seq, self._system_id, SIMULATOR_COMPONENT)

    @property
    def frame(self) -> PlantStateFrame:
        """The true state; read only."""
        return self._frame

    @property
    def shown(self) -> PlantStateFrame:
        """The state as sent, with its faults; read only."""
        return self._frame if self._faulty is None else self._faulty

    # ------------------------------------------------------------------ faults

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Active and scheduled faults."""
        return tuple(self._schedule.faults)

    def inject(self, fault: Fault) -> None:
        """Schedule a fault; one in the past begins at once. If two faults affect the same part, the last one wins."""
        self._schedule.faults.append(fault)
        self._update_faults()

    def clear_faults(self, rotor: int | None = None) -> None:
        """Remove all faults, scheduled ones too; with ``rotor``, the active faults of this rotor."""
        self._schedule.faults = [
            fault
            for fault in self._schedule.faults
            if rotor is not None and (fault.rotor != rotor or fault.begin_us > self.time_us)
        ]
        self._update_faults()

    def _update_faults(self) -> None:
        """Apply the active faults, and find the time of the next change."""
        schedule, now_us = self._schedule, self.time_us
        for rotor in range(len(self.vehicle.rotors)):
            self.plant.set_rotor_fault(rotor)
        state_fault: Fault | None = None
        for fault in schedule.take_due_levels(now_us):
            self.plant.set_charge(fault.value)
            if self.plant.battery is not None:
                self._battery_due_us = now_us  # report the change at once
        for fault in schedule.active(now_us):
            if fault.kind is Kind.ROTOR_OFF:
                self.plant.set_rotor_fault(fault.rotor, 1.0, 0.0)
            elif fault.kind is Kind.ROTOR_WEAK:
                self.plant.set_rotor_fault(fault.rotor, fault.value)
            elif fault.kind is Kind.ROTOR_STUCK:
                self.plant.set_rotor_fault(fault.rotor, 1.0, fault.value)
            else:
                state_fault = fault
        self._set_state_fault(None if state_fault is None else state_fault.kind)
        schedule.remove_past(now_us)
        change_us = schedule.next_change_us(now_us)
        self._change_us = _NEVER_US if change_us is None else change_us

    def _set_state_fault(self, kind: Kind | None) -> None:
        """Select the state that is sent from now on."""
        self.drops_state = kind is Kind.STATE_DROP
        if kind not in (Kind.STATE_FREEZE, Kind.STATE_NAN):
            self._faulty = None
            self._state_fault = kind
            return
        if self._faulty is not None and kind is self._state_fault:
            return  # unchanged: another fault began or ended
        self._state_fault = kind
        self._faulty = PlantStateFrame(self._system_id, SIMULATOR_COMPONENT)
        self._faulty.frame[:] = self._frame.frame
        self._faulty_flags = self._flags
        if kind is Kind.STATE_NAN:
            self._faulty.state[:] = math.nan

    # ------------------------------------------------------------------ time

    def apply(self, actuators: ActuatorsFrame) -> None:
        """Advance by one interval with the commands held; raise PlantDivergedError."""
        result = self.plant.advance(actuators.rotor_speed_rad_s, actuators.flags, self._steps)
        self.time_us += self._interval_us
        if result > CONTACT:
            self._set_flags(result)
        self._flags = _FLAGS[result]
        if self.time_us >= self._change_us:
            self._update_faults()

    def _set_flags(self, result: int) -> None:
        if result & DIVERGED:
            raise PlantDivergedError(
                f"the plant diverged at t={self.time_us * 1e-6:.3f} s: forces or rates are too large for the "
                "step; use a higher --physics-hz or smaller commands"
            )
        self._flags = _FLAGS[result]
