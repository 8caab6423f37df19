"""QGroundControl's guided actions on a vehicle that calls itself PX4."""

from __future__ import annotations

import math

from flightstack.mavlink.dialect import mavlink
from tests.interop.qgc_commands import Commands
from tests.interop.qgc_link import Station

HOLD, TAKEOFF, MISSION, RETURN, LAND = (4 << 16 | sub << 24 for sub in (3, 2, 4, 5, 6))
"""PX4CustomMode::AUTO_LOITER, _TAKEOFF, _MISSION, _RTL, _LAND: FirmwarePlugin/PX4/px4_custom_mode.h."""
MODE_TRIES, MODE_WAIT_S = 3, 1.3
ARM_WAIT_S = 1.5
FORCE = 21196.0
NAN = math.nan


class Actions:
    """FirmwarePlugin/PX4/PX4FirmwarePlugin.cc, with FirmwarePlugin.cc and Vehicle.cc below it.

    Each returns the result of its command, or whether the heartbeat confirmed it.
    """

    def __init__(self, station: Station, commands: Commands) -> None:
        self._station = station
        self._commands = commands

    # ------------------------------------------------------------------ modes and arming

    def set_flight_mode(self, custom_mode: int) -> bool:
        """FirmwarePlugin.cc, _setFlightModeAndValidate: SET_MODE is not acknowledged, the heartbeat tells.

        Vehicle.cc, setFlightMode, keeps the other bits of the base mode, also that of being armed.
        """
        for _ in range(MODE_TRIES):
            if self._station.custom_mode == custom_mode:
                return True
            base_mode = (
                self._station.latest["HEARTBEAT"].base_mode | mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            )
            self._station.send(mavlink.MAVLink_set_mode_message(self._station.system, base_mode, custom_mode))
            self._station.wait(
                "HEARTBEAT", within_s=MODE_WAIT_S, holds=lambda beat: beat.custom_mode == custom_mode
            )
        return self._station.custom_mode == custom_mode

    def arm(self, armed: bool = True) -> int:
        """Vehicle.cc, setArmed."""
        return self._commands.long(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, float(armed))

    def arm_and_validate(self) -> bool:
        """FirmwarePlugin.cc, _armVehicleAndValidate: once, and seen in the heartbeat within 1.5 s."""
        if not self._station.armed:
            self.arm()
        if not self._station.armed:
            self._station.wait("HEARTBEAT", within_s=ARM_WAIT_S, holds=lambda beat: self._station.armed)
        return self._station.armed

    def emergency_stop(self) -> int:
        """Vehicle.cc, emergencyStop."""
        return self._commands.long(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, FORCE)

    # ------------------------------------------------------------------ flying

    def take_off(self, above_m: float) -> int:
        """guidedModeTakeoff: NAV_TAKEOFF above the sea, and once that is accepted (_mavCommandResult) ARM."""
        altitude_m = above_m + self._station.altitude_amsl_m
        assert not math.isnan(altitude_m), "unable to take off, vehicle position not known"
        result = self._commands.long(mavlink.MAV_CMD_NAV_TAKEOFF, -1.0, 0.0, 0.0, NAN, NAN, NAN, altitude_m)
        if result == mavlink.MAV_RESULT_ACCEPTED and not self._station.armed:
            return self.arm()
        return result

    def start_takeoff(self) -> bool:
        """startTakeoff: the mode, then arming."""
        return self.set_flight_mode(TAKEOFF) and self.arm_and_validate()

    def land(self) -> bool:
        """guidedModeLand."""
        return self.set_flight_mode(LAND)

    def return_home(self) -> bool:
        """guidedModeRTL."""
        return self.set_flight_mode(RETURN)

    def pause(self) -> int:
        """pauseVehicle: DO_REPOSITION with nothing but the mode."""
        return self._reposition(NAN, NAN)

    def go_to(self, latitude: float, longitude: float) -> int:
        """guidedModeGotoLocation: COMMAND_INT, in frame GLOBAL, at the altitude at which it is."""
        first = (-1.0, float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE), 0.0, NAN)
        place = (latitude, longitude, self._station.altitude_amsl_m)
        return self._commands.integer(mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_FRAME_GLOBAL, first, place)

    def change_altitude(self, by_m: float, pause: bool = True) -> int:
        """guidedModeChangeAltitude, _changeAltAfterPause: home's altitude and the relative one, after a pause."""
        altitude_m = self._station.home_altitude_m + self._station.altitude_relative_m + by_m
        if pause and (result := self.pause()) != mavlink.MAV_RESULT_ACCEPTED:
            return result
        return self._reposition(NAN, altitude_m)

    def change_heading(self, heading_rad: float) -> int:
        """guidedModeChangeHeading: radians, clockwise from north."""
        return self._reposition(heading_rad, NAN)

    def change_speed(self, speed_m_s: float) -> int:
        """guidedModeChangeGroundSpeedMetersSecond."""
        return self._commands.long(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0, 0.0, NAN, NAN, NAN)

    def _reposition(self, yaw_rad: float, altitude_m: float) -> int:
        flags = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
        return self._commands.long(
            mavlink.MAV_CMD_DO_REPOSITION, -1.0, flags, 0.0, yaw_rad, NAN, NAN, altitude_m
        )

    # ------------------------------------------------------------------ missions

    def start_mission(self) -> bool:
        """startMission: the mode, then arming."""
        return self.set_flight_mode(MISSION) and self.arm_and_validate()

    def continue_mission(self) -> bool:
        """FlyView/GuidedActionsController.qml, actionContinueMission: the same as to start it."""
        return self.start_mission()

    def set_current_item(self, shown: int) -> int:
        """Vehicle.cc, setCurrentMissionSequence: without home, so one less than shown."""
        return self._commands.long(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, float(shown - 1))
