"""Record the autopilot's events and loops in flight logs, one per flight from arming to disarming."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flightstack.commander.transitions import Status
from flightstack.core.arrays import store_outer_row
from flightstack.core.compiled import direct
from flightstack.core.contract import (
    ATTITUDE_TARGET_SIZE,
    SETPOINT_SIZE,
    STATE_SIZE,
    FloatArray,
    LoopRow,
    Vector3,
)
from flightstack.core.enums import NAVIGATION_STATE
from flightstack.core.geodesy import GeoPoint
from flightstack.core.periods import next_due
from flightstack.flight_log.flight_log import FlightLog
from flightstack.flight_log.row_block import RowBlock
from flightstack.flight_log.topics import (
    ARMING_STATE_ARMED,
    ARMING_STATE_DISARMED,
    BATTERY_GROUP,
    OUTER,
    OUTER_GROUP,
    Group,
)
from flightstack.guidance.mission import MissionProgress

if TYPE_CHECKING:
    from flightstack.simulator_link.endpoint import Battery

OpenLog = Callable[[], FlightLog | None]
_BATTERY_INTERVAL_US = 500_000


class FlightRecorder:
    """Records what the autopilot reports. Without an open log, rows go to a scratch row."""

    def __init__(
        self,
        open_log: OpenLog,
        info: Mapping[str, str | int | float],
        parameters: Callable[[], Mapping[str, float]],
        home: GeoPoint,
        battery: Callable[[], Battery],
        groups: Sequence[Group] = (),
        outer: Group = OUTER_GROUP,
    ) -> None:
        """``parameters`` returns the values at the start of a log; ``home`` is the origin of the local frame.

        ``battery`` returns the newest report. ``groups`` are further topics, ``outer`` those of the outer loop.
        """
        self._open_log = open_log
        self._info = info
        self._parameters = parameters
        self._origin = home
        self._battery, self._battery_due_us = battery, 0
        self._home = (home, Vector3(0.0, 0.0, 0.0))
        self._groups, self._outer = (BATTERY_GROUP, *groups), outer
        self.estimate = np.zeros(outer.columns - OUTER.size)
        """Further columns of each row of the outer loop, written in place; none of a vehicle on the true state."""
        self._log: FlightLog | None = None
        scratch = np.zeros(LoopRow.SIZE)
        self._no_row: Callable[[int], FloatArray] = lambda _: scratch
        self.inner_row: Callable[[int], FloatArray] = self._no_row
        """Return the row for the inner loop at a time [µs]; the scratch row without an open log."""
        sizes = (OUTER.size, STATE_SIZE, SETPOINT_SIZE, ATTITUDE_TARGET_SIZE)
        self._store_outer = direct(store_outer_row, *(np.zeros(size) for size in sizes), 0)
        RowBlock((), 0)  # compile its kernel now and not at the first flight
        self._mission = (MissionProgress(0, -1, False, False), 0)
        self._missions = 0
        self._armed = False
        self._error: OSError | None = None

    @property
    def log(self) -> FlightLog | None:
        """The open log."""
        return self._log

    @property
    def battery_due_us(self) -> int:
        """Time from which ``battery`` records it."""
        return self._battery_due_us

    @property
    def is_logging(self) -> bool:
        """True while a log is open."""
        return self._log is not None

    def discard_row(self) -> None:
        """Discard the newest row of ``inner_row``, which failing loops did not fill."""
        if self._log is not None and self._log.inner.n:
            self._log.inner.n -= 1

    def outer(
        self,
        time_us: int,
        state: FloatArray,
        setpoint: FloatArray,
        attitude_target: FloatArray,
        loop_flags: int,
    ) -> None:
        """Record one outer tick; ``loop_flags`` are ``LoopFlags``, 0 while the loops are idle."""
        if self._log is None:
            return
        row = self._log.outer.append(time_us)
        self._store_outer(row, state, setpoint, attitude_target, loop_flags)
        if len(self.estimate):
            row[OUTER.size :] = self.estimate

    def battery(self, time_us: int) -> None:
        """Record the battery if it is due; at the begin of the outer tick at ``time_us``."""
        if self._log is None or time_us < self._battery_due_us:
            return
        self._battery_due_us = next_due(time_us, _BATTERY_INTERVAL_US)
        battery = self._battery()
        if battery.valid or not math.isnan(battery.voltage_v):
            self._log.sampled[BATTERY_GROUP.name].append(time_us)[:] = battery[:3]

    def status(self, time_us: int, status: Status, failsafe: bool = False) -> None:
        """Record mode, arming state and active failsafe; arming starts a log and disarming ends it."""
        if status.armed and not self._armed:  # not again in a flight whose log failed
            self._begin(time_us)
        self._armed = status.armed
        if self._log is None:
            return
        self._log.event(
            "vehicle_status",
            time_us,
            nav_state_timestamp=time_us,
            arming_state=ARMING_STATE_ARMED if status.armed else ARMING_STATE_DISARMED,
            nav_state=NAVIGATION_STATE[status.mode],
            failsafe=int(failsafe),
            pre_flight_checks_pass=1,
        )
        if not status.armed:
            self.close()

    def _begin(self, time_us: int) -> None:
        self._log = self._open_log()
        if self._log is None:
            return
        self.inner_row = self._log.inner.append
        self._battery_due_us = time_us
        self._log.start(time_us, self._info, self._parameters(), self._origin, self._groups, self._outer)
        self._write_home(time_us)
        self.landed(time_us, True)
        self._write_mission(time_us)
        self.battery(time_us)

    def landed(self, time_us: int, landed: bool) -> None:
        """Record a change of the land detector."""
        if self._log is not None:
            self._log.event("vehicle_land_detected", time_us, landed=int(landed), ground_contact=int(landed))

    def home(self, time_us: int, home: GeoPoint, position_ned_m: Vector3) -> None:
        """Record where home is now."""
        self._home = (home, position_ned_m)
        self._write_home(time_us)

    def set_origin(self, origin: GeoPoint) -> None:
        """Set the origin of the local frame of the next logs."""
        self._origin = origin

    def _write_home(self, time_us: int) -> None:
        if self._log is None:
            return
        (lat, lon, alt), (x, y, z) = self._home
        self._log.event("home_position", time_us, lat=lat, lon=lon, alt=alt, x=x, y=y, z=z)

    def mission(self, time_us: int, progress: MissionProgress, count: int) -> None:
        """Record progress of the mission."""
        if count != self._mission[1] or progress.reached < self._mission[0].reached:
            self._missions += 1
        self._mission = (progress, count)
        self._write_mission(time_us)

    def _write_mission(self, time_us: int) -> None:
        if self._log is None:
            return
        progress, count = self._mission
        self._log.event(
            "mission_result",
            time_us,
            seq_reached=progress.reached,
            seq_current=min(progress.current, max(0, count - 1)),
            seq_total=count,
            mission_update_counter=self._missions,
            valid=int(count > 0),
            finished=int(progress.finished),
        )

    def timing(self, time_us: int, **figures: float) -> None:
        """Record the timing of the loops; in lockstep only deterministic values."""
        if self._log is not None:
            self._log.event("loop_timing", time_us, **figures)

    def parameter(self, name: str, value: float) -> None:
        """Record a change of a parameter."""
        if self._log is not None:
            self._log.parameter(name, value)

    def text(self, time_us: int, severity: int, text: str) -> None:
        """Record a text."""
        if self._log is not None:
            self._log.message(time_us, severity, text)

    def take_error(self) -> OSError | None:
        """Return the error that ended a log early and clear it, or None. The flight continues without a log."""
        if self._log is not None and self._log.error is not None:
            self.close()
        error, self._error = self._error, None
        return error

    def close(self) -> None:
        """Close the log; the next flight opens another."""
        if self._log is not None:
            self._log.close()
            self._error = self._log.error
            self._log = None
            self.inner_row = self._no_row
