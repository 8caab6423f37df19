"""Navigator: setpoint of the outer loop for the mode, by one compiled kernel per outer tick."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from flightstack.core.compiled import direct
from flightstack.core.contract import (
    ATTITUDE_TARGET_SIZE,
    SETPOINT_SIZE,
    STATE_SIZE,
    FloatArray,
    RecordArray,
    Vector3,
)
from flightstack.core.enums import STREAM_MODES, Mode
from flightstack.core.portable_math import atan2, distance
from flightstack.guidance.kernels import (
    TRAJECTORY_SIZE,
    GoalArrays,
    goal_kernel,
    levelling_kernel,
    mode_numbers,
    rest_kernel,
    stream_kernel,
)
from flightstack.guidance.land_detector import CONTACT_M_S, LEVELLING_LIFT, REST_M_S, LandMemory
from flightstack.guidance.manual import TAKEOFF_STICK, shaped
from flightstack.guidance.mission import (
    CONDITION_YAW,
    LOG_SIZE,
    MISSION,
    NAV_DELAY,
    PLAN_ITEM,
    MissionProgress,
    mission_lands,
    mission_start,
)
from flightstack.guidance.mission import LAND as LAND_ITEM
from flightstack.guidance.mode_target import CLIMBING, MODE_TARGET, lands
from flightstack.guidance.offboard import wants_to_rise
from flightstack.guidance.params import GuidanceParams, SpeedOverrides
from flightstack.guidance.setpoints import (
    ATTITUDE,
    OffboardSetpoint,
    Sticks,
    empty_stream,
    store_setpoint,
)
from flightstack.guidance.trajectory import BRAKING, Trajectory

LEVEL_S = 0.1
"""Time constant of levelling in ground contact: a step would make the vehicle hop."""
ARRIVED_M = 0.5
"""Distance from a commanded position at which the vehicle has arrived."""
# looking up a member of an enumeration takes seven times as long as looking up a name or a key
_OFFBOARD = Mode.OFFBOARD
_STREAM_NUMBERS = frozenset(int(mode) for mode in STREAM_MODES)


class Navigator:
    """Holds the state of guidance and enters modes. No I/O, no clock."""

    def __init__(self, params: GuidanceParams, outer_hz: float) -> None:
        self._speeds = SpeedOverrides()
        self._given_params = self.params = params
        self._params_array = np.array(params, dtype=np.float64)
        self._dt_s = 1.0 / outer_hz
        self.setpoint = np.zeros(SETPOINT_SIZE)
        self._trajectory = np.zeros(TRAJECTORY_SIZE)
        self._mission: RecordArray = np.zeros(1, MISSION)
        # a field is read ten times as fast through a memoryview of it
        views = (self._mission[name].data for name in MissionProgress._fields)
        self._current, self._reached, self._finished, self._wants_return = views
        self._reported = 0
        self._numbers = mode_numbers(position=True, velocity=True)
        self._is_repositioning = False
        self._mode_target: RecordArray = np.zeros(1, MODE_TARGET)
        self._land = np.array(LandMemory(1.0, 0.0, 0.0, 0.0))
        self._land_view = self._land.data  # a number of an array takes four times as long to read
        self._stream = empty_stream()
        self._stream_kind = self._stream["kind"].data
        self.attitude_target = np.eye(1, ATTITUDE_TARGET_SIZE)[0]
        """Attitude target that replaces the outer loop's while ``flies_attitude``; array form."""
        self._plan: RecordArray = np.zeros(0, PLAN_ITEM)
        self.set_plan(self._plan, np.zeros(0))
        state, target = np.zeros(STATE_SIZE), np.zeros(ATTITUDE_TARGET_SIZE)
        self._levelling_target = target.copy()
        self._rest = direct(rest_kernel, state, self._trajectory, self._land, self.setpoint)
        self._level = direct(levelling_kernel, target, 1.0, 1.0, self._levelling_target)
        self._fly_goal = direct(
            goal_kernel, 0, state, *self.goal[:6], target, 0.0, self._params_array, self._dt_s, self.setpoint
        )

    @cached_property
    def _fly_stream(self) -> Callable[..., Any]:
        """The kernel of modes that follow a stream. In lockstep, its compilation takes no time of the vehicle."""
        state, target = np.zeros(STATE_SIZE), np.zeros(ATTITUDE_TARGET_SIZE)
        return direct(
            stream_kernel, 0, state, self._trajectory, self._stream, self._land, target, 0.0,
            self._params_array, self._dt_s, self.setpoint, self.attitude_target,
        )  # fmt: skip

    def warm_up_streams(self) -> None:
        """Compile the kernel of modes that follow a stream, or load it from the cache, before its first use."""
        self._fly_stream  # noqa: B018

    # ------------------------------------------------------------------ parameters

    def set_params(self, params: GuidanceParams) -> None:
        """Set new parameters, from the next outer tick on; commanded speeds stay in force.

        A mission uses the new speed too, unless one of its items has set another.
        """
        self._given_params = params._replace(
            ground_down_m=self.params.ground_down_m, ceiling_down_m=self.params.ceiling_down_m
        )
        before, self.params = self.params, self._speeds.applied_to(self._given_params)
        self._params_array[:] = self.params
        m = self._mission[0]
        if m["speed"] == before.cruise_speed_m_s:
            m["speed"] = self.params.cruise_speed_m_s
        if m["yaw_rate"] == before.yaw_rate_rad_s:
            m["yaw_rate"] = self.params.yaw_rate_rad_s

    def set_speed(self, speeds: SpeedOverrides) -> None:
        """Override the speeds of the parameters until the end of the flight."""
        if speeds == self._speeds:
            return
        self._speeds = speeds
        self.set_params(self._given_params)
        self._mission[0]["speed"] = self.params.cruise_speed_m_s

    def set_bounds(self, ground_down_m: float, ceiling_down_m: float) -> None:
        """Set the assumed ground, and the ceiling that guidance exceeds only for a plan [m NED]."""
        bounds = {"ground_down_m": ground_down_m, "ceiling_down_m": ceiling_down_m}
        self.params = self.params._replace(**bounds)
        self.set_params(self._given_params)

    @property
    def speeds(self) -> SpeedOverrides:
        """Commanded speeds."""
        return self._speeds

    # ------------------------------------------------------------------ state

    @property
    def goal(self) -> GoalArrays:
        """The arguments of ``goal_kernel`` that are guidance's own; a new plan has other arrays."""
        return GoalArrays(
            self._trajectory, self._mission, self._plan, self._jumps_left, self._mode_target, self._land,
            self._params_array, self._dt_s,
        )  # fmt: skip

    @property
    def modes(self) -> Mapping[Mode, int]:
        """Numbers of the modes, for ``goal_kernel``."""
        return self._numbers

    @property
    def landed(self) -> bool:
        """True if the vehicle is landed."""
        return self._land_view[0] > 0.0

    @property
    def touches_ground(self) -> bool:
        """True in ground contact: landed, or about to be reported as landed."""
        return self._land_view[1] >= CONTACT_M_S

    @property
    def rests(self) -> bool:
        """True if ground contact has persisted, so that the loops stop."""
        return self._land_view[1] >= REST_M_S

    def levelling_target(self, attitude_target: FloatArray) -> FloatArray:
        """Return the next attitude target in ground contact, shape (5,), with little thrust.

        It levels from the last target, ``attitude_target``, with the time constant ``LEVEL_S``. The outer loop would
        wind up against wind that friction withstands.
        """
        thrust_n = LEVELLING_LIFT * self.params.weight_n
        self._level(attitude_target, thrust_n, self._dt_s / LEVEL_S, self._levelling_target)
        return self._levelling_target

    @property
    def progress(self) -> MissionProgress:
        """Progress of the mission."""
        return MissionProgress(
            self._current[0], self._reached[0], bool(self._finished[0]), bool(self._wants_return[0])
        )

    @property
    def mission_flies(self) -> bool:
        """True if the current item needs the vehicle in the air; a landed vehicle may wait out the other items."""
        current = self._current[0]
        if self._finished[0] or current >= len(self._plan):
            return False
        return self._plan[current]["command"] not in (LAND_ITEM, NAV_DELAY, CONDITION_YAW)

    def reached_items(self) -> list[int]:
        """Return the items reached since the last call, in order."""
        m = self._mission[0]
        count = int(m["log_count"])
        fresh = range(max(self._reported, count - LOG_SIZE), count)
        self._reported = count
        return [int(m["log"][index % LOG_SIZE]) for index in fresh]

    def set_plan(self, plan: RecordArray, jumps: FloatArray) -> None:
        """Set a new plan, to be flown from its first item; ``jumps`` are the repeats of its DO_JUMPs."""
        self._plan = np.ascontiguousarray(plan)
        self._jumps = np.ascontiguousarray(jumps)
        self.restart_plan()

    def change_plan(self, plan: RecordArray, jumps: FloatArray) -> None:
        """Replace the values of the same plan; the mission continues with its progress and jump counts."""
        self._plan = np.ascontiguousarray(plan)
        self._jumps = np.ascontiguousarray(jumps)

    def restart_plan(self) -> None:
        """Make the first item the current one and restore the repeats of the jumps."""
        self._jumps_left = self._jumps.copy()
        self.set_current(0)

    def set_current(self, index: int) -> None:
        """Make ``index`` the mission's current item."""
        t, target = self._reference(), self._mode_target[0]
        mission_start(self._mission[0], index, t, self.params)
        target["start_x"], target["start_y"] = t.x, t.y

    def _reference(self) -> Trajectory:
        """Return the state of the reference point."""
        return Trajectory(*self._trajectory.tolist())

    def reset_on_ground(self, state: FloatArray) -> None:
        """Set the reference to the vehicle's position, at rest and landed; ignore a state that is not finite."""
        self._rest(state, self._trajectory, self._land, self.setpoint)

    def reset_reference(self, state: FloatArray) -> None:
        """Set the reference to the vehicle's position and velocity, because it cannot follow the old reference."""
        if not np.isfinite(state).all():
            return
        self._trajectory[:6] = state[:6]
        self._trajectory[6:9] = 0.0

    def set_known(self, position: bool, velocity: bool) -> bool:
        """Fly with or without horizontal position and velocity; return True if that is a change.

        Without a position, LAND descends where the vehicle is, and POSITION holds the altitude alone. A landing goes on
        where the position is known again.
        """
        numbers = mode_numbers(position, velocity)
        if numbers is self._numbers:
            return False
        self._numbers = numbers
        self._mode_target["x"], self._mode_target["y"] = self._trajectory[:2]
        return True

    def shift(self, mode: Mode, position_m: Vector3, velocity_m_s: Vector3, yaw_rad: float) -> None:
        """Shift the reference by a reset of the estimate, so that the vehicle does not move.

        Goals keep their place, but for that of a descent to land: the vehicle would reach the ground on the way there.
        """
        for x in (self._trajectory, self.setpoint):
            x[0:3] += position_m
            x[3:6] += velocity_m_s
            x[9] += yaw_rad
        goal, is_landing = self._mode_target, lands(mode, self._mode_target[0])
        if mode == Mode.MISSION:
            goal, is_landing = self._mission, mission_lands(self._mission[0], self._plan)
        if is_landing:
            goal["x"] += position_m.x
            goal["y"] += position_m.y

    def enter(self, mode: Mode, takeoff_altitude_m: float = 0.0) -> None:
        """Set the target of ``mode``, from the present reference."""
        t, target, p = self._reference(), self._mode_target[0], self.params
        self._is_repositioning = False
        target["x"], target["y"], target["z"], target["yaw"], target["speed"] = t.x, t.y, t.z, t.yaw_rad, 0.0
        if mode == Mode.TAKEOFF:
            target["z"] = -takeoff_altitude_m
        elif mode == Mode.HOLD:  # stopping position of the reference
            speed = distance(t.vx, t.vy)
            ahead_s = speed / (2.0 * BRAKING * p.acceleration_m_s2)
            target["x"], target["y"] = t.x + t.vx * ahead_s, t.y + t.vy * ahead_s
            target["z"] = t.z + t.vz * abs(t.vz) / (2.0 * BRAKING * p.vertical_acceleration_m_s2)
        elif mode == Mode.RETURN:
            self._enter_return()
        elif mode == Mode.MISSION:
            self._enter_mission()

    def _enter_return(self) -> None:
        """Climb to the return altitude above the destination, unless it is near or the vehicle is higher.

        The ceiling has priority: a return must not breach the fence that may have caused it.
        """
        t, target, p = self._reference(), self._mode_target[0], self.params
        target["phase"] = CLIMBING
        if distance(t.x - target["home_x"], t.y - target["home_y"]) > p.return_min_distance_m:
            target["z"] = min(t.z, target["home_z"] - p.return_altitude_m)
        target["z"] = max(target["z"], p.ceiling_down_m)

    def return_to(self, north_m: float, east_m: float, ground_down_m: float) -> None:
        """Set the destination of the next return [m NED]: home or a rally point."""
        target = self._mode_target[0]
        target["home_x"], target["home_y"], target["home_z"] = north_m, east_m, ground_down_m

    def reposition(
        self, north_m: float, east_m: float, down_m: float, yaw_rad: float, speed_m_s: float = math.nan
    ) -> None:
        """Hold at another position [m NED]; NaN keeps the present value, for the heading subject to MPC_YAW_MODE.

        Call after entering HOLD.
        """
        t, target = self._reference(), self._mode_target[0]
        self._is_repositioning = True
        if math.isfinite(north_m) and math.isfinite(east_m):
            target["x"], target["y"] = north_m, east_m
            away_m = distance(north_m - t.x, east_m - t.y)
            if math.isnan(yaw_rad) and self.params.yaw_mode < 0.5 and away_m > 1.0:
                yaw_rad = atan2(east_m - t.y, north_m - t.x)
        if math.isfinite(down_m):
            target["z"] = down_m
        if math.isfinite(yaw_rad):
            target["yaw"] = yaw_rad
        if speed_m_s > 0.0:
            target["speed"] = min(speed_m_s, self.params.max_speed_m_s)

    @property
    def goes_elsewhere(self) -> bool:
        """True while HOLD is on its way to the position of ``reposition``."""
        if not self._is_repositioning:
            return False
        t, target = self._reference(), self._mode_target[0]
        return distance(t.x - target["x"], t.y - target["y"], t.z - target["z"]) > ARRIVED_M

    def _enter_mission(self) -> None:
        """Restart the current item from here, with speed and heading set by earlier items.

        A finished mission restarts at its first item.
        """
        m = self._mission[0]
        if m["finished"]:
            self.restart_plan()
            return
        reached, speed, yaw_is_set, yaw = m["reached"], m["speed"], m["yaw_is_set"], m["yaw"]
        self.set_current(int(m["current"]))
        m["reached"], m["speed"], m["yaw_is_set"] = reached, speed, yaw_is_set
        if yaw_is_set:
            m["yaw"] = yaw

    def hold_at_last_item(self) -> None:
        """Hold at the last goal of the mission that has just ended."""
        m, target = self._mission[0], self._mode_target[0]
        target["x"], target["y"], target["z"], target["yaw"] = m["x"], m["y"], m["z"], m["yaw"]

    # ------------------------------------------------------------------ streams

    def set_offboard(self, setpoint: OffboardSetpoint, max_thrust_n: float) -> None:
        """Store the newest offboard setpoint for OFFBOARD."""
        store_setpoint(self._stream, setpoint, max_thrust_n)

    def set_sticks(self, sticks: Sticks) -> None:
        """Store the stick positions for POSITION and ALTITUDE."""
        self._stream["sticks"] = sticks

    def flies_attitude(self, mode: Mode) -> bool:
        """Return True if guidance sets attitude and thrust itself, in ``attitude_target``."""
        return mode is _OFFBOARD and self._stream_kind[0] >= ATTITUDE

    def wants_to_rise(self, mode: Mode, down_m: float) -> bool:
        """Return True if the stream commands a takeoff of a vehicle landed at ``down_m``."""
        s, p = self._stream[0], self.params
        if mode is not Mode.OFFBOARD:
            return shaped(s["sticks"][2], p.stick_deadzone, p.stick_z_expo) > TAKEOFF_STICK
        return wants_to_rise(s, down_m, p.weight_n)

    # ------------------------------------------------------------------ ticks

    def step(self, mode: Mode, state: FloatArray, attitude_target: FloatArray, rotor_thrust_n: float) -> None:
        """Advance by one outer tick and write ``setpoint``, and ``attitude_target`` while ``flies_attitude``.

        ``attitude_target`` (5,) is the loops' last one, ``rotor_thrust_n`` the thrust of the rotors by their speeds.
        """
        number = self._numbers[mode]
        if number in _STREAM_NUMBERS:
            self._fly_stream(
                number, state, self._trajectory, self._stream, self._land, attitude_target, rotor_thrust_n,
                self._params_array, self._dt_s, self.setpoint, self.attitude_target,
            )  # fmt: skip
            return
        self._fly_goal(
            number, state, self._trajectory, self._mission, self._plan, self._jumps_left, self._mode_target,
            self._land, attitude_target, rotor_thrust_n, self._params_array, self._dt_s, self.setpoint,
        )  # fmt: skip
