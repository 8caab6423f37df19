"""Parameter servers and clients on a link that loses messages."""

from __future__ import annotations

from hypothesis import strategies as st

from gcs_cli.clients.param_client import ParamDone
from tests.protocol.param_harness import Station, World, store_of

SEEDS = st.integers(0, 2**32)


NAN, INF = float("nan"), float("inf")


def world_of(count: int = 100) -> World:
    return World(store_of(count), Station("gcs"), Station("other", system=254))


def all_told(world: World, result: object) -> bool:
    return (
        isinstance(result, ParamDone)
        and {told.name: told.value for told in result.parameters} == world.store.values()
    )


def ignore_errors(station: Station) -> None:
    """Let PARAM_ERROR not arrive, as with a vehicle that does not send it."""
    receive = station.client.receive
    station.client.receive = lambda message, now_s: (  # type: ignore[method-assign]
        None if message.get_type() == "PARAM_ERROR" else receive(message, now_s)
    )
