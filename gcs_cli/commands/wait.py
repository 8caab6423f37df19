"""``gcs wait``: end when the vehicle is in a state, for shell scripts."""

from __future__ import annotations

from typing import Annotated

import typer

from flightstack.process.command_line import expand_options, make_app
from gcs_cli.actions.conditions import (
    COMPLETE,
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
from gcs_cli.vehicle.view_types import Mission
from gcs_cli.vehicle_link import connect_vehicle

app = make_app(add_completion=False)

DEFAULT_TIMEOUT_S = 60.0


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


class _Items:
    """Downloads the mission of a vehicle that does not report its state: the view has to know the last item."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._asked: Mission | None = None

    def are_needed(self) -> bool:
        """Return True if the vehicle has a mission that was not asked for yet."""
        mission, asked = self._connection.session.view.mission, self._asked
        if mission.state is not None or not mission.total:
            return False
        return asked is None or (mission.mission_id, mission.total) != (asked.mission_id, asked.total)

    def download(self) -> None:
        """Download the items; without them a return at their end is not recognised, which is printed."""
        session = self._connection.session
        self._asked = session.view.mission
        try:
            self._connection.complete(calls.download(session), "mission download")
        except VehicleLostError:
            raise
        except CliError as error:
            typer.echo(
                f"gcs: wait {COMPLETE}: {error}; a mission that ends with a return is not seen as complete",
                err=True,
            )


def wait_for(connection: Connection, wanted: list[ViewCondition], timeout_s: float, output: Output) -> None:
    """Wait until all conditions hold; raise CliError after ``timeout_s``, or if the vehicle is lost."""
    session, begun_s, items = connection.session, connection.now_s, _Items(connection)
    needs_items = any(condition.text == COMPLETE for condition in wanted)

    def ends() -> bool:
        view = session.view
        is_gone = view.powered_off or view.lost(connection.now_s)
        return is_gone or all(condition.holds(view) for condition in wanted)

    def pauses() -> bool:
        return ends() or (needs_items and items.are_needed())

    while (in_time := connection.wait_for(pauses, begun_s + timeout_s - connection.now_s)) and not ends():
        items.download()
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
