"""pymavlink's own connection to a vehicle, to see with eyes that are not ours what another client did to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink import mavutil

from tests.support.process import BOUND_S

MOST_UNWANTED = 20_000
"""Messages of the wanted type that may come before the right one: minutes of the fastest stream."""


class Witness:
    """A connection of pymavlink; ``url`` as ``mavutil.mavlink_connection`` takes it."""

    def __init__(self, url: str, system: int, **options: Any) -> None:
        """Open it; ``system`` is the vehicle's."""
        self.connection = mavutil.mavlink_connection(url, **options)
        self.system = system
        self.connection.target_system, self.connection.target_component = system, 1
        self.beat()  # a link that has sent nothing gets heartbeats alone
        self.until("HEARTBEAT")

    @property
    def mav(self) -> Any:
        """What sends messages."""
        return self.connection.mav

    def beat(self) -> None:
        """Send the HEARTBEAT of a ground station."""
        self.mav.heartbeat_send(mavutil.mavlink.MAV_TYPE_GCS, mavutil.mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)

    def until(self, kind: str | list[str], holds: Callable[[Any], object] = lambda message: True) -> Any:
        """Return the next message of a type (or of several) from the vehicle for which ``holds``."""
        seen = None
        for _ in range(MOST_UNWANTED):
            message = self.connection.recv_match(type=kind, blocking=True, timeout=BOUND_S)
            if message is None:
                break
            if message.get_srcSystem() == self.system and holds(message):
                return message
            seen = message
        raise AssertionError(f"no such {kind} came; the last was {seen}")

    def until_modes(self, *custom_modes: int) -> None:
        """Wait until the heartbeats have shown these modes, in this order: each change sends one at once."""
        for custom_mode in custom_modes:
            self.until("HEARTBEAT", lambda beat, wanted=custom_mode: beat.custom_mode == wanted)

    def catch_up(self) -> None:
        """Forget what came so far."""
        while self.connection.recv_match(blocking=False) is not None:
            pass

    def command(self, number: int, *params: float, component: int = 1) -> Any:
        """Send a COMMAND_LONG and return its acknowledgement, that of an earlier one aside."""
        values = (*params, *[0.0] * (7 - len(params)))
        self.mav.command_long_send(self.system, component, number, 0, *values)
        return self.until("COMMAND_ACK", lambda ack: ack.command == number)

    def arm(self) -> None:
        """Arm with the verb of pymavlink's users, as soon as the vehicle says that it can be armed."""
        ready = mavutil.mavlink.MAV_SYS_STATUS_PREARM_CHECK
        self.until("SYS_STATUS", lambda status: status.onboard_control_sensors_health & ready)
        self.connection.arducopter_arm()
        arming = mavutil.mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        ack = self.until("COMMAND_ACK", lambda ack: ack.command == arming)
        assert ack.result == mavutil.mavlink.MAV_RESULT_ACCEPTED, self.connection.messages.get("STATUSTEXT")
        self.connection.motors_armed_wait()

    def close(self) -> None:
        self.connection.close()
