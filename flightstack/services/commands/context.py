"""Command, answer and context of the command handlers."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeAlias

from flightstack.core.geodesy import LocalFrame
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address
from flightstack.params.store import ParamStore
from flightstack.services.logs.log_store import LogStore
from flightstack.vehicle.assembly import VehicleParts
from flightstack.vehicle.flight_state import FlightState, Journal
from flightstack.vehicle.mode_control import Readiness, Takeoff
from flightstack.vehicle.plans import FlightArea, Mission
from flightstack.vehicle.requests import FlightRequests

ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
REJECTED = int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
DENIED = int(mavlink.MAV_RESULT_DENIED)
UNSUPPORTED = int(mavlink.MAV_RESULT_UNSUPPORTED)
FAILED = int(mavlink.MAV_RESULT_FAILED)
UNSUPPORTED_FRAME = 9
"""MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME, which pymavlink's dialect lacks."""
RELATIVE_FRAMES = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
ABSOLUTE_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT, None)
"""Frames of altitudes above home (relative) and above sea level (absolute); a COMMAND_LONG has no frame."""


class Command(NamedTuple):
    """A command from COMMAND_LONG or COMMAND_INT."""

    command: int
    params: tuple[float, float, float, float, float, float, float]
    """NaN stays NaN. Parameters 5 and 6 of a COMMAND_INT are degrees, metres or plain numbers, by its frame."""
    is_int: bool
    frame: int | None
    """MAV_FRAME of a COMMAND_INT; a COMMAND_LONG has none."""
    peer: Hashable
    source: Address
    confirmation: int


class Answer(NamedTuple):
    """Result of a command, and the reason of a refusal."""

    result: int
    reason: str = ""


def answer_to(refusal: str | None) -> Answer:
    """Return ACCEPTED, or TEMPORARILY_REJECTED with the refusal."""
    return Answer(ACCEPTED) if refusal is None else Answer(REJECTED, refusal)


def frame_answer(command: Command) -> Answer | None:
    """Return the refusal of a command with an unsupported frame, or None."""
    if command.frame in RELATIVE_FRAMES or command.frame in ABSOLUTE_FRAMES:
        return None
    return Answer(UNSUPPORTED_FRAME, f"frame {command.frame} is not supported")


class FailureLink(Protocol):
    """Interface to inject failures into the simulator."""

    @property
    def has_state(self) -> bool:
        """True if the simulator has sent a state."""

    def ask_for_failure(self, unit: int, failure: int, instance: int) -> None:
        """Request a failure, with the parameters of MAV_CMD_INJECT_FAILURE."""

    def take_failure_result(self) -> int | None:
        """Return the MAV_RESULT of the request once; None while there is none."""


PrepareReboot: TypeAlias = Callable[[], str | None]
"""Prepares the reboot of the process; returns the reason that it is not possible, or None."""


def always_reboots() -> None:
    """Return None: a vehicle without a process needs no preparation."""


@dataclass
class VehicleContext:
    """The parts of the vehicle that command handlers use."""

    now: FlightState
    journal: Journal
    requests: FlightRequests
    readiness: Readiness
    mission: Mission
    area: FlightArea
    takeoff: Takeoff
    frame: LocalFrame
    params: ParamStore
    simulator: FailureLink
    is_generic: bool
    """True if the vehicle reports MAV_AUTOPILOT_GENERIC (FS_AUTOPILOT); fixed at start."""
    logs: LogStore
    prepare_reboot: PrepareReboot
    shutdown_requested: bool = False
    reboot_requested: bool = False

    @classmethod
    def of(
        cls,
        parts: VehicleParts,
        params: ParamStore,
        simulator: FailureLink,
        is_generic: bool,
        logs: LogStore,
        prepare_reboot: PrepareReboot,
    ) -> VehicleContext:
        """Return the context for the vehicle of ``parts``."""
        return cls(
            parts.now, parts.journal, parts.requests, parts.readiness, parts.mission, parts.area, parts.takeoff,
            parts.places.frame, params, simulator, is_generic, logs, prepare_reboot,
        )  # fmt: skip


Handler: TypeAlias = Callable[[VehicleContext, Command], Answer]
