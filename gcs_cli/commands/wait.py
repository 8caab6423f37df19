"""``gcs wait``: end when the vehicle is in a state, for shell scripts."""

from __future__ import annotations

from typing import Annotated

import typer

from flightstack.mavlink.dialect import mavlink
from flightstack.process.command_line import expand_options, make_app
from gcs_cli.actions.conditions import (
    COMPLETE,
    Completion,
    ConditionError,
    ViewCondition,
    choices,
    parse_condition,
)
from gcs_cli.actions.on_vehicle import find_mode, mode_choices
from gcs_cli.errors import NO_ANSWER, USAGE, CliError, VehicleLostError
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.link.perform import ask_modes, request_reached
from gcs_cli.output import Output
from gcs_cli.settings import LinkOptions, link_options, output_of
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

DEFAULT_TIMEOUT_S = 60.0
_CURRENT_S = 2.0
"""Longest wait for MISSION_CURRENT, which a vehicle without a mission may not send."""


@app.command()
@expand_options
def wait(
    context: typer.Context,
    link: LinkOptions,
    conditions: Annotated[
        list[str],
        typer.Argument(metavar="CONDITION...", help=f"{choices()}. Quote > and <.", show_default=False),
    ],
) -> None:
    """Wait until the vehicle is in a state.

    Several conditions must hold at once. Exit code 1: the vehicle was lost; 3: --timeout passed. It limits the search
    for the vehicle, 5 s by default, and then the wait, 60 s by default, both in real time.
    """
    wanted = [_parsed(text) for text in conditions]
    given = link_options(context, link).timeout
    timeout_s = DEFAULT_TIMEOUT_S if given is None else given
    with connect_vehicle(context, link) as connection:
        _check_modes(connection, wanted)
        request_reached(connection)
        wanted = [_informed(connection, condition) for condition in wanted]
        wait_for(connection, wanted, timeout_s, output_of(context, link))


def _parsed(text: str) -> ViewCondition:
    try:
        return parse_condition(text)
    except ConditionError as error:
        raise CliError(f"wait: {error}", USAGE) from None


def _check_modes(connection: Connection, wanted: list[ViewCondition]) -> None:
    """Raise CliError (usage) for a mode that the vehicle does not have."""
    for condition in wanted:
        if condition.mode and find_mode(connection.session.view, condition.mode) is None:
            ask_modes(connection)  # the vehicle may have modes of its own
            view = connection.session.view
            if find_mode(view, condition.mode) is None:
                names = ", ".join(name.lower() for name in mode_choices(view))
                raise CliError(
                    f"wait {condition.text}: the vehicle has no such mode; choose one of {names}", USAGE
                )


def _informed(connection: Connection, condition: ViewCondition) -> ViewCondition:
    """Return ``complete`` with what it needs of a vehicle that does not report the state of its mission."""
    if condition.text != COMPLETE:
        return condition
    session = connection.session
    connection.wait_for(lambda: session.view.mission.current is not None, _CURRENT_S)
    mission = session.view.mission
    is_unknown = mission.state is None and mission.total is not None and not connection.is_recording
    items = connection.complete(calls.download(session), "wait complete").items if is_unknown else ()
    returns = bool(items) and items[-1].command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
    return condition._replace(holds=Completion(returns).holds)


def wait_for(connection: Connection, wanted: list[ViewCondition], timeout_s: float, output: Output) -> None:
    """Wait until all conditions hold; raise CliError after ``timeout_s``, or if the vehicle is lost."""
    session, begun_s = connection.session, connection.now_s

    def ends() -> bool:
        view = session.view
        is_gone = view.powered_off or view.lost(connection.now_s)
        return is_gone or all(condition.holds(view) for condition in wanted)

    in_time = connection.wait_for(ends, timeout_s)
    view = session.view
    if all(condition.holds(view) for condition in wanted):
        words = [condition.text for condition in wanted]
        elapsed_s = round(connection.now_s - begun_s, 3)
        output.say("wait", ", ".join(words), conditions=words, elapsed_s=elapsed_s)
        return
    missing = [condition for condition in wanted if not condition.holds(view)]
    if in_time:
        how = "shut down" if view.powered_off else "was lost"
        raise VehicleLostError(f"wait {missing[0].text}: the vehicle {how}")
    states = "; ".join(f"{condition.text}: {condition.value(view)}" for condition in missing)
    raise CliError(f"wait: not within {timeout_s:g} s: {states}", NO_ANSWER)
