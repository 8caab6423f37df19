"""The flight stack's end of the simulator link, without I/O.

A simulator is asked for FS_PLANT_STATE (exact, one frame each way per step) and, if it does not know that, for
HIL_STATE_QUATERNION, as PX4 asks; whichever arrives is answered in kind.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.contract import MAX_ROTORS, STATE_SIZE, FloatArray
from flightstack.geodesy import GeoPoint, LocalFrame
from flightstack.mavlink.dialect import FS_PLANT_STATE_ID, mavlink
from flightstack.mavlink.hot_frames import (
    ARMED_FLAG,
    LOCKSTEP_FLAG,
    ActuatorsFrame,
    PlantStateFrame,
)
from flightstack.mavlink.link import Link, Message
from flightstack.params.vehicle import Vehicle

HIL_ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED | mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
HIL_DISARMED = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
HIL_LOCKSTEP = 1


class SimulatorLink:
    """Takes the simulator's bytes, keeps the newest state, and makes the answer to it.

    ``state`` (13,) and ``rotor_speed_rad_s`` (8,) are the same arrays for the link's whole life.
    """

    def __init__(self, vehicle: Vehicle, home: GeoPoint, lockstep: bool, system_id: int = 1) -> None:
        self._link = Link(system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._plant = PlantStateFrame()
        self._actuators = ActuatorsFrame(system_id)
        self._actuators.set_rotor_count(len(vehicle.rotors))
        self._frame = LocalFrame(home)
        self._top_speed = np.array([min(r.max_speed_rad_s, 1e6) for r in vehicle.rotors])
        self._lockstep = LOCKSTEP_FLAG if lockstep else 0
        self._speaks_hil = False
        self.state: FloatArray = self._plant.state
        self.state[6] = 1.0
        self.rotor_speed_rad_s = self._plant.rotor_speed_rad_s
        self.time_us = 0
        self.has_state = False
        self.request_refused = False
        self.peer_said_goodbye = False

    def hello(self, interval_us: int) -> bytes:
        """Return the bytes to send after connecting: who we are, and our own state message every so often."""
        return self.heartbeat(False) + self._request(FS_PLANT_STATE_ID, interval_us)

    def second_hello(self, interval_us: int) -> bytes:
        """Return the request to a simulator that does not know our message: PX4's."""
        return self._request(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, interval_us)

    def _request(self, message_id: int, interval_us: int) -> bytes:
        request = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return self._link.encode(
            mavlink.MAVLink_command_long_message(0, 0, request, 0, message_id, interval_us, 0, 0, 0, 0, 0)
        )

    def heartbeat(self, armed: bool, leaving: bool = False) -> bytes:
        """Return a heartbeat; ``leaving`` announces an orderly end."""
        return self._link.encode(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_QUADROTOR,
                mavlink.MAV_AUTOPILOT_PX4,
                HIL_ARMED if armed else HIL_DISARMED,
                0,
                mavlink.MAV_STATE_POWEROFF if leaving else mavlink.MAV_STATE_ACTIVE,
                3,
            )
        )

    def receive(self, data: memoryview) -> bool:
        """Take bytes from the simulator; tell whether a new state arrived.

        A whole state is taken at once, whatever the general decoder waits for: that can only be junk.
        """
        if self._plant.open(data):
            self.time_us = self._plant.time_us
            self.has_state = True
            self._speaks_hil = False
            return True
        return self._receive_any(bytes(data))

    def _receive_any(self, data: bytes) -> bool:
        fresh = False
        for message in self._link.decode(data):
            kind = message.get_msgId()
            if kind == FS_PLANT_STATE_ID:
                self._take_plant_state(message)
                fresh = True
            elif kind == mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION:
                self._take_hil(message)
                fresh = True
            elif kind == mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
                self.request_refused = message.result != mavlink.MAV_RESULT_ACCEPTED
            elif kind == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
                self.peer_said_goodbye = message.system_status == mavlink.MAV_STATE_POWEROFF
        self.has_state = self.has_state or fresh
        return fresh

    def _take_plant_state(self, m: Message) -> None:
        """Take a frame that the general decoder read: it may be signed, or cut where its payload ends in zeros."""
        self._speaks_hil = False
        self.state[:] = (*m.position_ned_m, *m.velocity_ned_m_s, *m.q, *m.rates_frd_rad_s)
        self.rotor_speed_rad_s[:] = m.rotor_speed_rad_s
        self.time_us = m.time_us

    def _take_hil(self, m: Message) -> None:
        self._speaks_hil = True
        position = self._frame.to_ned(GeoPoint(m.lat / 1e7, m.lon / 1e7, m.alt / 1e3))
        velocity = (m.vx / 100.0, m.vy / 100.0, m.vz / 100.0)
        rates = (m.rollspeed, m.pitchspeed, m.yawspeed)
        self.state[:STATE_SIZE] = (*position, *velocity, *m.attitude_quaternion, *rates)
        self.time_us = m.time_usec

    def answer(self, rotor_speed_rad_s: FloatArray, armed: bool) -> bytes | memoryview:
        """Return the answer to the newest state: rotor speeds (8,), commanded."""
        if self._speaks_hil:
            return self._hil_answer(rotor_speed_rad_s, armed)
        self._actuators.rotor_speed_rad_s[:] = rotor_speed_rad_s
        return self._actuators.seal(self.time_us, self._lockstep | (ARMED_FLAG if armed else 0))

    def _hil_answer(self, rotor_speed_rad_s: FloatArray, armed: bool) -> bytes:
        count = self._top_speed.size
        thrust = np.clip(rotor_speed_rad_s[:count] / self._top_speed, 0.0, 1.0) ** 2
        controls = [value if math.isfinite(value) else 0.0 for value in thrust.tolist()]
        controls += [0.0] * (16 - count)
        if not armed:
            controls = [0.0] * 16
        return self._link.encode(
            mavlink.MAVLink_hil_actuator_controls_message(
                self.time_us,
                controls,
                HIL_ARMED if armed else HIL_DISARMED,
                HIL_LOCKSTEP if self._lockstep else 0,
            )
        )


assert MAX_ROTORS <= 16
