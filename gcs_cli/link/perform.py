"""Perform an action over a connection, and print how it went."""

from __future__ import annotations

from typing import Any

from flightstack.mavlink.dialect import mavlink
from gcs_cli.actions.action import Action
from gcs_cli.actions.run import ActionRun, Outcome, Result
from gcs_cli.clients.command_client import ModeClient
from gcs_cli.errors import FAILED, INTERRUPTED, NO_ANSWER, USAGE, CliError
from gcs_cli.link.connection import Connection
from gcs_cli.output import Output

EXIT_CODES = {
    Outcome.REFUSED: FAILED,
    Outcome.ENDED: FAILED,
    Outcome.IMPOSSIBLE: USAGE,
    Outcome.SILENT: NO_ANSWER,
    Outcome.NOT_SEEN: NO_ANSWER,
}
_STEP_S = 0.25


def perform(connection: Connection, action: Action, output: Output, *, waits: bool = True) -> Result:
    """Perform ``action``; raise CliError unless it succeeds. A flight is announced when it begins."""
    session = connection.session
    run = ActionRun(action, lambda: session.view, connection.now_s, session.own, waits=waits)
    session.use(run)
    announced = False
    try:
        while run.result is None:
            connection.step(connection.now_s + _STEP_S)
            if run.acknowledged and run.step is not None and run.step.is_flight and not announced:
                announced = True
                _say(output, action, action.doing, state=Outcome.ACKNOWLEDGED.value)
    except KeyboardInterrupt:
        raise CliError(f"interrupted while {action.doing}: the vehicle continues", INTERRUPTED) from None
    finally:
        session.use(None)
    result = run.result
    if not result.ok:
        raise CliError(result.sentence, EXIT_CODES[result.outcome])
    if not (announced and result.outcome is Outcome.ACKNOWLEDGED):
        after = f" after {result.elapsed_s:.1f} s" if announced else ""
        _say(
            output,
            action,
            result.sentence + after,
            state=result.outcome.value,
            elapsed_s=round(result.elapsed_s, 3),
        )
    return result


def _say(output: Output, action: Action, sentence: str, **facts: Any) -> None:
    output.say(action.name.replace(" ", "_").replace("-", "_"), sentence, **{**action.facts, **facts})


def ask_modes(connection: Connection) -> bool:
    """Ask the vehicle for its modes, which then are in the view; return False if it does not list them."""
    session = connection.session
    client = ModeClient(lambda: session.view, session.own, connection.now_s)
    connection.run(client, "list of modes")
    return bool(client.result)


def request_reached(connection: Connection) -> None:
    """Request MISSION_ITEM_REACHED, and do not wait for it: other vehicles than this project's send it once only."""
    message_id = mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED
    if not connection.is_recording and message_id not in connection.session.view.autopilot.lacks_messages:
        number, rest = float(message_id), (0.0,) * 6
        request = mavlink.MAV_CMD_REQUEST_MESSAGE
        connection.send(
            mavlink.MAVLink_command_long_message(*connection.session.target, request, 0, number, *rest)
        )
