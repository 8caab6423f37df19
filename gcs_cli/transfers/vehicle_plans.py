"""The plan that a vehicle holds, and the parameters that limit plans."""

from __future__ import annotations

from flightstack.core.geodesy import GeoPoint
from flightstack.plan import DEFAULT_LIMITS, MissionType, Plan
from gcs_cli.autopilots.px4 import PX4
from gcs_cli.errors import FAILED, CliError
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.plans.check import LIMIT_PARAMETERS, Problem, limits_of, plan_problems
from gcs_cli.plans.itinerary import home_of_items
from gcs_cli.transfers import param_calls

_HOME_WAIT_S = 3.0
_VERSION_WAIT_S = 1.0
KINDS = (MissionType.MISSION, MissionType.FENCE, MissionType.RALLY)


def download_plan(connection: Connection, *, with_home: bool, kinds: tuple[MissionType, ...] = KINDS) -> Plan:
    """Return the vehicle's plan; raise CliError. A part that the vehicle does not support is empty."""
    session = connection.session
    items, fence, rally = (
        connection.complete(
            calls.download(session, kind), "download", may_lack=kind != MissionType.MISSION
        ).items
        if kind in kinds
        else ()
        for kind in KINDS
    )
    if with_home:
        connection.wait_for(lambda: session.view.home is not None, _HOME_WAIT_S)
    home = session.view.home
    return Plan(items, None if home is None else GeoPoint(*home[:3]), fence=fence, rally=rally)


def limit_parameters(connection: Connection) -> dict[str, float]:
    """Return those of LIMIT_PARAMETERS that the vehicle has; raise CliError if it does not answer."""
    found = {}
    for name in LIMIT_PARAMETERS:
        try:
            found[name] = param_calls.fetch(connection, name).value
        except CliError as error:
            if error.exit_code != FAILED:
                raise
    return found


def is_own_vehicle(connection: Connection) -> bool:
    """Return True for the vehicle of this project, which announces itself as PX4; raise CliError without an answer."""
    session = connection.session
    if session.view.is_own is None and session.view.autopilot.name == PX4.name:
        try:
            connection.command(calls.REQUEST_VERSION, "request of the version")
        except CliError as error:
            if error.exit_code != FAILED:
                raise
            return False
        connection.wait_for(lambda: session.view.is_own is not None, _VERSION_WAIT_S)
    return bool(session.view.is_own)


def problems_on_vehicle(connection: Connection, plan: Plan) -> tuple[list[Problem], str]:
    """Return the problems of ``plan`` with the vehicle's home, geofence and limits, and what could not be checked.

    Raise CliError.
    """
    stored = download_plan(connection, with_home=True, kinds=(MissionType.FENCE,))
    autopilot = connection.session.view.autopilot
    is_foreign = not is_own_vehicle(connection)
    limits = DEFAULT_LIMITS if is_foreign else limits_of(limit_parameters(connection))
    home = home_of_items(plan.items, stored.home or plan.home)
    found = list(plan_problems(plan, home, limits, stored.fence, is_foreign=is_foreign))
    unchecked = f"only the geofence is checked: the commands of {autopilot.title} are not known"
    return found, unchecked if is_foreign else ""
