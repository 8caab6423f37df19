"""Start, pause, resume and jump: each waits until the vehicle reports the effect."""

from __future__ import annotations

from collections.abc import Callable

from flightstack.mavlink.dialect import mavlink
from gcs_cli.errors import FAILED, CliError
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection

EFFECT_TIMEOUT_S = 5.0
"""Longest time between the acknowledgement of a command and its effect."""
_MISSION_MODES, _PAUSED_MODES = ("MISSION", "AUTO"), ("HOLD", "BRAKE", "LOITER")
_HOLD = (4, 3)  # PX4's main and sub mode


def start(connection: Connection) -> None:
    """Start the mission; raise CliError if it is refused, or if the vehicle does not fly it."""
    connection.command(calls.START_MISSION, "mission start")
    view = connection.session
    _wait(connection, "mission start", "armed", lambda: view.view.armed)
    _wait(connection, "mission start", "in mission mode", lambda: view.view.mode in _MISSION_MODES)


def pause(connection: Connection) -> int | None:
    """Hold the position; return the current item, None if it is unknown. Raise CliError."""
    _require_mission(connection, "mission pause")
    connection.command(calls.mode_command(*_HOLD), "mission pause")
    session = connection.session
    _wait(connection, "mission pause", "in hold mode", lambda: session.view.mode in _PAUSED_MODES)
    return session.view.mission.current


def resume(connection: Connection) -> int | None:
    """Fly the mission from its current item; return it, None if it is unknown. Raise CliError."""
    session = connection.session
    if not session.view.armed:
        raise CliError("mission resume: the vehicle is not armed: use `gcs mission start`", FAILED)
    connection.command(calls.START_MISSION, "mission resume")
    _wait(connection, "mission resume", "in mission mode", lambda: session.view.mode in _MISSION_MODES)
    return session.view.mission.current


def jump(connection: Connection, seq: int) -> None:
    """Make item ``seq`` the current one; raise CliError.

    DO_SET_MISSION_CURRENT answers with a reason; vehicles without it take MISSION_SET_CURRENT.
    """
    name = f"mission jump {seq}"
    session = connection.session
    number = seq + calls.mission_begins_with_home(session)
    command = int(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT), (float(number),)
    call = calls.command(session, *command, connection.now_s)
    answer = connection.wait_for_answer(call, name)
    if answer.result == mavlink.MAV_RESULT_UNSUPPORTED or answer.silent:
        connection.complete(calls.set_current(session, seq), name)
        return
    connection.check_answer(answer, name)
    _wait(connection, name, f"at item {seq}", lambda: session.view.mission.current == number)


def _require_mission(connection: Connection, name: str) -> None:
    session = connection.session
    if not (session.view.armed and session.view.mode in _MISSION_MODES):
        raise CliError(f"{name}: the vehicle does not fly a mission (mode {session.view.mode})", FAILED)


def _wait(connection: Connection, name: str, effect: str, holds: Callable[[], bool]) -> None:
    """Wait for an effect; raise CliError with the vehicle's last text if it does not come."""
    texts = connection.session.view.text_count
    if connection.wait_for(holds, EFFECT_TIMEOUT_S):
        return
    view = connection.session.view
    said = view.texts_since(texts)
    reason = f": {said[-1].text}" if said else ""
    raise CliError(
        f"{name}: the vehicle acknowledged the command, but is not {effect} after {EFFECT_TIMEOUT_S:g} s{reason}",
        FAILED,
    )
