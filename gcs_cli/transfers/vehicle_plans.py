"""The plan that a vehicle holds, and the parameters that limit plans."""

from __future__ import annotations

from flightstack.core.geodesy import GeoPoint
from flightstack.plan import MissionType, Plan
from gcs_cli.errors import FAILED, CliError
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.plans.check import LIMIT_PARAMETERS
from gcs_cli.transfers import param_calls

_HOME_WAIT_S = 3.0
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
