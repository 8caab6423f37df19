"""Commands to the whole vehicle: home, stored parameters, termination, reboot, shutdown and injected failures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from flightstack.commander.transitions import Need
from flightstack.core.enums import Severity
from flightstack.core.geodesy import GeoPoint
from flightstack.mavlink.dialect import mavlink
from flightstack.services.commands.context import (
    ACCEPTED,
    DENIED,
    FAILED,
    REJECTED,
    RELATIVE_FRAMES,
    UNSUPPORTED,
    Answer,
    Command,
    FailureLink,
    Handler,
    VehicleContext,
    answer_to,
    frame_answer,
)

DO_NOTHING, REBOOT, SHUT_DOWN = 0.0, 1.0, 2.0
_WRITE, _RESET, _FACTORY_RESET = 1.0, 2.0, 4.0


def store_or_reset_parameters(vehicle: VehicleContext, command: Command) -> Answer:
    """PREFLIGHT_STORAGE: parameter 1 is 2 or 4 to reset all parameters; 1 (write) is accepted without effect.

    The store writes every change at once.
    """
    action = command.params[0]
    if action not in (_WRITE, _RESET, _FACTORY_RESET):
        return Answer(UNSUPPORTED)
    if action != _WRITE:
        if vehicle.now.status.armed:
            return Answer(DENIED, "the vehicle is armed")
        vehicle.params.reset()
    return Answer(ACCEPTED)


def reboot_or_shut_down(vehicle: VehicleContext, command: Command) -> Answer:
    """PREFLIGHT_REBOOT_SHUTDOWN: parameter 1 is 1 to reboot, 2 to shut down; denied during takeoff and in the air."""
    action = command.params[0]
    if action == DO_NOTHING:
        return Answer(ACCEPTED)
    if action not in (REBOOT, SHUT_DOWN):
        return Answer(UNSUPPORTED)
    now = vehicle.now
    if now.status.armed and (now.flying or not now.landed):
        return Answer(DENIED, "the vehicle is taking off" if now.landed else "the vehicle is in the air")
    if action == REBOOT and not vehicle.reboot_requested:
        problem = vehicle.prepare_reboot()
        if problem is not None:
            return Answer(FAILED, problem)
    vehicle.shutdown_requested = action == SHUT_DOWN
    vehicle.reboot_requested = action == REBOOT
    return Answer(ACCEPTED)


def terminate_flight(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_FLIGHTTERMINATION: parameter 1 above 0.5 (PX4's threshold) stops the rotors until a reboot, in the air too."""
    if not command.params[0] > 0.5:  # True for NaN
        return Answer(DENIED, "parameter 1 must be 1; a termination cannot be taken back")
    if not vehicle.now.status.armed:
        return answer_to(Need.ARMED.value)
    vehicle.requests.terminate("commanded")
    return Answer(ACCEPTED)


def set_home(vehicle: VehicleContext, command: Command) -> Answer:
    """DO_SET_HOME: parameter 1 is 1 for the current position, else 5 to 7 are latitude, longitude and altitude AMSL.

    As in PX4, a given position stays home for later flights; otherwise home moves to where the vehicle arms next.
    """
    if command.params[0] == 1.0:
        if not vehicle.readiness.facts.state_is_valid:
            return answer_to(Need.STATE.value)
        refusal = vehicle.area.set_home_here()
    else:
        unsupported = frame_answer(command)
        if unsupported is not None:
            return unsupported
        latitude, longitude, altitude = command.params[4:7]
        if command.frame in RELATIVE_FRAMES:
            altitude += vehicle.area.home.altitude_m
        refusal = vehicle.area.set_home(GeoPoint(latitude, longitude, altitude))
    if refusal is not None:
        return Answer(DENIED, refusal)
    vehicle.journal.say(Severity.NOTICE, "Home set")
    return Answer(ACCEPTED)


HANDLERS: dict[int, Handler] = {
    mavlink.MAV_CMD_PREFLIGHT_STORAGE: store_or_reset_parameters,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: reboot_or_shut_down,
    mavlink.MAV_CMD_DO_FLIGHTTERMINATION: terminate_flight,
    mavlink.MAV_CMD_DO_SET_HOME: set_home,
}


LONGEST_WAIT_S = 1.5
"""Timeout of the simulator's answer, which takes one step. MAVSDK waits 2 s for the acknowledgement."""
_HIGHEST = 255.0
_REASONS = {
    DENIED: "the simulator has no such motor, battery or sensor",
    UNSUPPORTED: "the simulator does not support this failure, or sends no such sensor",
}


class FailureCommands:
    """Forwards one failure at a time."""

    def __init__(self, simulator: FailureLink, are_allowed: Callable[[], bool]) -> None:
        """``are_allowed`` returns True if SYS_FAILURE_EN is set."""
        self._simulator = simulator
        self._are_allowed = are_allowed
        self._waiting: tuple[Command, float] | None = None

    def begin(self, command: Command, now_s: float) -> Answer | None:
        """Request the failure from the simulator; return the answer if it is refused at once."""
        numbers = command.params[:3]
        if not self._are_allowed():
            return Answer(DENIED, "failures are not allowed: SYS_FAILURE_EN is 0")
        if not self._simulator.has_state:
            return Answer(REJECTED, "no simulator is connected")
        if not all(0.0 <= number <= _HIGHEST and number == math.floor(number) for number in numbers):
            return Answer(DENIED, "unit, type and instance of a failure are whole numbers, 0 to 255")
        if self._waiting is not None:
            return Answer(REJECTED, "another failure waits for the simulator's answer")
        self._waiting = (command, now_s)
        self._simulator.ask_for_failure(*(int(number) for number in numbers))
        return None

    def poll(self, now_s: float) -> Iterator[tuple[Command, Answer]]:
        """Yield the command that can be answered now, with its answer."""
        if self._waiting is None:
            return
        command, asked_s = self._waiting
        result = self._simulator.take_failure_result()
        if result is not None:
            answer = Answer(
                result, "" if result == ACCEPTED else _REASONS.get(result, "the simulator refused")
            )
        elif now_s - asked_s > LONGEST_WAIT_S:
            answer = Answer(FAILED, "the simulator does not answer")
        else:
            return
        self._waiting = None
        yield command, answer

    def next_deadline(self) -> float | None:
        """Return −inf while the simulator's answer is awaited, which may come at any time, else None."""
        return None if self._waiting is None else -math.inf
