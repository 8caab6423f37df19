"""One request to the vehicle and its answer, with the vehicle's reason if it is refused. Sans-IO."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple, Protocol, TypeAlias

from flightstack.core.enums import Severity
from flightstack.core.geodesy import GeoPoint
from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID, mavlink
from flightstack.mavlink.link import Address
from flightstack.plan import MissionItem, MissionResult, MissionType
from gcs_cli.clients.command_client import CommandClient, CommandResult
from gcs_cli.clients.mission_client import Done, Failed, MissionClient
from gcs_cli.link.session import Session
from gcs_cli.plans.compare import EXACT, PACKED_ITEMS, Tolerance
from gcs_cli.plans.names import any_command_name

TEXT_WAIT_S = 0.3
"""Timeout of the STATUSTEXT that explains a refusal; it follows the answer."""

_PREFIXES = (
    "Command refused: ",
    "Mission refused: ",
    "Geofence refused: ",
    "List of rally points refused: ",
)
_NAMES_ITEM = re.compile(r"\bitem \d", re.IGNORECASE)
"""A text with the number of the refused item; PX4's "IGN MISSION_ITEM: Invalid item" has none."""


class Answer(NamedTuple):
    """Result of a request."""

    accepted: bool
    reason: str = ""
    """The reason of a refusal: the vehicle's STATUSTEXT, if it sent one."""
    silent: bool = False
    """True if the vehicle did not answer."""
    cancelled: bool = False
    """True if the ground station ended the request."""
    items: tuple[MissionItem, ...] = ()
    """The plan, of a download."""
    result: int = 0
    """The MAV_RESULT of a command, or the MAV_MISSION_RESULT of a transfer; 0: accepted."""


class Request(Protocol):
    """One pending request, or several in sequence."""

    def answer(self, now_s: float) -> Answer | None:
        """Return the answer once it is known."""


class Call:
    """A pending request. It is the session's service until it is answered."""

    def __init__(
        self, session: Session, client: CommandClient | MissionClient, items: Sequence[MissionItem] = ()
    ) -> None:
        self._items = tuple(items)  # of an upload
        self._session = session
        self._client = client
        self._texts_before = session.view.text_count
        self._text_due_s: float | None = None
        session.use(client)

    @property
    def progress(self) -> tuple[int, int]:
        """Transferred items and their total, of a mission transfer."""
        return self._client.progress if isinstance(self._client, MissionClient) else (0, 0)

    def answer(self, now_s: float) -> Answer | None:
        """Return the answer once it is known."""
        result = self._client.result
        if result is None:
            return None
        if isinstance(result, Done):
            return Answer(True, items=result.items)
        if isinstance(result, CommandResult) and result.accepted:
            return Answer(True)
        silent = result.result is None or (
            isinstance(result, Failed) and result.result == MissionResult.OPERATION_CANCELLED
        )
        if silent:
            return Answer(False, result.reason, silent=True)
        return self._refusal(result, now_s)

    def _refusal(self, result: CommandResult | Failed, now_s: float) -> Answer | None:
        """Return the refusal with the vehicle's STATUSTEXT, which may still follow; and with the refused item."""
        text = self._explanation()
        if not text:
            if self._text_due_s is None:
                self._text_due_s = now_s + TEXT_WAIT_S
            if now_s < self._text_due_s:
                return None
        reason = text or result.reason
        if isinstance(result, Failed) and not (text and (result.is_whole or _NAMES_ITEM.search(text))):
            item = self._refused_item(result)
            reason = f"{item}: {reason}" if item else reason
        return Answer(False, reason, result=result.result or 0)

    def _refused_item(self, failed: Failed) -> str:
        """Return the item that the vehicle refused, as text; MISSION_ACK does not name it."""
        if failed.seq is None or failed.seq >= len(self._items):
            return ""
        name = f"item {failed.seq} ({any_command_name(self._items[failed.seq].command)})"
        return f"{name} or one before it" if failed.is_whole and failed.seq else name

    def _explanation(self) -> str:
        texts = [
            entry.text
            for entry in self._session.view.texts_since(self._texts_before)
            if entry.severity <= Severity.WARNING
        ]
        text = texts[-1] if texts else ""
        for prefix in _PREFIXES:
            text = text.removeprefix(prefix)
        return text


def command(session: Session, number: int, params: Sequence[float], now_s: float) -> Call:
    """Begin a command; omitted parameters are zero."""
    client = CommandClient(vehicle_address(session), session.own)
    client.send(number, params, now_s)
    return Call(session, client)


def command_int(
    session: Session, number: int, params: Sequence[float], x: int, y: int, z: float, frame: int, now_s: float
) -> Call:
    """Begin a COMMAND_INT of four parameters and a position in ``frame``; x and y in 1e-7 degrees."""
    client = CommandClient(vehicle_address(session), session.own)
    client.send_int(number, params, x, y, z, frame=frame, now_s=now_s)
    return Call(session, client)


def upload(session: Session, items: Sequence[MissionItem], kind: MissionType = MissionType.MISSION) -> Call:
    """Begin to upload a mission, geofence or rally points; an upload without items clears them."""
    client = mission_client(session, kind)
    client.start_upload(items)
    return Call(session, client, items)


def download(session: Session, kind: MissionType = MissionType.MISSION) -> Call:
    """Begin to download the mission, geofence or rally points."""
    client = mission_client(session, kind)
    client.start_download()
    return Call(session, client)


def clear(session: Session, kind: MissionType = MissionType.MISSION) -> Call:
    """Begin to clear the mission, geofence, rally points or all."""
    client = mission_client(session, kind)
    client.start_clear()
    return Call(session, client)


def mission_client(session: Session, kind: MissionType) -> MissionClient:
    """Return a client that transfers one type of plan."""
    home = session.view.home
    return MissionClient(
        vehicle_address(session),
        session.own,
        kind,
        begins_with_home=session.view.autopilot.mission_begins_with_home,
        home=None if home is None else GeoPoint(*home[:3]),
    )


def storage_tolerance(session: Session) -> Tolerance:
    """Return the differences that the vehicle's storage makes."""
    autopilot = session.view.autopilot
    if autopilot.stores_items_exactly:
        return EXACT
    return PACKED_ITEMS._replace(packing=autopilot.packing(session.view.vehicle_type))


def vehicle_address(session: Session) -> Address:
    """Return system and component of the vehicle."""
    return Address(*session.target)


Command: TypeAlias = tuple[int, Sequence[float]]
"""A MAV_CMD and its parameters."""

NAN = math.nan
ARM: Command = (int(mavlink.MAV_CMD_COMPONENT_ARM_DISARM), (1.0,))
DISARM: Command = (int(mavlink.MAV_CMD_COMPONENT_ARM_DISARM), (0.0,))
FORCE_DISARM: Command = (int(mavlink.MAV_CMD_COMPONENT_ARM_DISARM), (0.0, 21196.0))  # MAVLink's magic number
LAND: Command = (int(mavlink.MAV_CMD_NAV_LAND), (0.0, 0.0, 0.0, NAN, NAN, NAN, NAN))
RETURN: Command = (int(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH), ())
START_MISSION: Command = (int(mavlink.MAV_CMD_MISSION_START), ())
REBOOT: Command = (int(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN), (1.0,))
RESET_PARAMETERS: Command = (int(mavlink.MAV_CMD_PREFLIGHT_STORAGE), (2.0,))
SHUT_DOWN: Command = (int(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN), (2.0,))
_REQUEST = int(mavlink.MAV_CMD_REQUEST_MESSAGE)
REQUEST_MISSION_CURRENT: Command = (_REQUEST, (float(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT),))
REQUEST_VERSION: Command = (_REQUEST, (float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION),))
REQUEST_LOOP_TIMING: Command = (_REQUEST, (float(FS_LOOP_TIMING_ID),))
REQUEST_SYS_STATUS: Command = (_REQUEST, (float(mavlink.MAVLINK_MSG_ID_SYS_STATUS),))


def takeoff_command(altitude_amsl_m: float = NAN) -> Command:
    """Return the command to take off to an altitude above mean sea level; NaN: the vehicle's default."""
    return int(mavlink.MAV_CMD_NAV_TAKEOFF), (0.0, 0.0, 0.0, NAN, NAN, NAN, altitude_amsl_m)


def goto_command(latitude_deg: float, longitude_deg: float, altitude_amsl_m: float = NAN) -> Command:
    """Return the command to hold at another position; NaN keeps the altitude."""
    change_mode = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
    params = (-1.0, change_mode, 0.0, NAN, latitude_deg, longitude_deg, altitude_amsl_m)
    return int(mavlink.MAV_CMD_DO_REPOSITION), params


def speed_command(speed_m_s: float) -> Command:
    """Return the command to set the ground speed."""
    return int(mavlink.MAV_CMD_DO_CHANGE_SPEED), (1.0, speed_m_s, -1.0)


def mode_command(main: int, sub: int) -> Command:
    """Return the command that selects a PX4 mode."""
    base = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
    return int(mavlink.MAV_CMD_DO_SET_MODE), (base, float(main), float(sub))
