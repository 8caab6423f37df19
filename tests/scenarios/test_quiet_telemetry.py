"""Clients hear what they hear with an exchange of messages in each period, at the same times."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from flightstack.testing import Client, World
from flightstack.testing.artifacts import Flown
from flightstack.testing.network import Network
from gcs_cli.link.tlog import decode_records
from tests.support.bytes_engine import BytesEngine


def _heard(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, bytes]]:
    """Times and bytes of what clients receive from now on."""
    found: list[tuple[float, bytes]] = []
    receive_all = Client.receive_all

    def received(client: Client, datagrams: Iterable[bytes], now_s: float) -> None:
        arrived = list(datagrams)
        found.extend((now_s, data) for data in arrived)
        receive_all(client, arrived, now_s)

    monkeypatch.setattr(Client, "receive_all", received)
    return found


def hops(world: World) -> None:
    """Take off and land."""
    world.wait_until_ready()
    world.takeoff(1.0)
    world.run_for(3.0)
    world.land()
    world.run_until("not armed")


def reports(world: World) -> None:
    """Texts of the estimate come between those of the autopilot."""
    world.wait_until_ready()
    world.takeoff(2.0)
    world.run_for(2.0)
    world.fault("sensor:mag:off", for_s=1.196)
    world.run_for(5.0)


def boots(world: World) -> None:
    """Wait, without a look at the vehicle, and boot again."""
    world.run_for(4.0)
    world.power_cycle(0.5)
    world.run_for(4.0)


def jumps(world: World) -> None:
    """The periods of the outer loop are no longer those of messages."""
    world.wait_until_ready()
    world.takeoff(2.0)
    world.run_for(2.0)
    world.fault("clock jump 0.404")
    world.run_for(3.0)


_HEARD = (
    ("truth", hops, {"outer_hz": 125.0}), ("estimated", hops, {}), ("estimated", reports, {}),
    ("estimated", reports, {"inner_hz": 400.0, "outer_hz": 400.0}), ("estimated", boots, {"seed": 7}),
    ("truth", jumps, {}), ("estimated", jumps, {}), ("truth", boots, {}),
)  # fmt: skip


@pytest.mark.parametrize("telemetry", [False, True])
@pytest.mark.parametrize(("state", "fly", "rates"), _HEARD)
def test_clients_hear_the_same_at_the_same_times(
    state: str,
    fly: Callable[[World], None],
    rates: dict[str, float],
    telemetry: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As with an exchange of messages in each period, and of bytes between vehicle and simulator in each tick."""
    found = _heard(monkeypatch)
    with World(state=state, telemetry=telemetry, **rates) as world:
        fly(world)
    quiet = found[:]
    found.clear()
    monkeypatch.setattr(Network, "idle_s", lambda *_, **__: 0.0)
    with World(state=state, telemetry=telemetry, make_engine=BytesEngine, **rates) as world:
        fly(world)
    assert quiet == found
    assert len(quiet) > 30


def test_a_client_reacts_to_telemetry_in_its_period(monkeypatch: pytest.MonkeyPatch) -> None:
    class Lander:
        """Lands above 1 m."""

        def __init__(self) -> None:
            self.is_due = False

        def receive(self, message: Any, now_s: float) -> None:
            self.is_due |= message.get_type() == "LOCAL_POSITION_NED" and message.z < -1.0

        def poll(self, now_s: float) -> list[Any]:
            due, self.is_due = self.is_due, False
            command = mavlink.MAV_CMD_NAV_LAND
            return [mavlink.MAVLink_command_long_message(1, 1, command, 0, *[0.0] * 7)] if due else []

        def next_deadline(self) -> float | None:
            return 0.0 if self.is_due else None

    def landed(world: World) -> tuple[bytes, list[str]]:
        world.gcs.session.attach(Lander())
        world.takeoff(2.0)
        world.run_for(6.0)
        return world.engine.newest_log(), world.texts

    with World(state="truth", telemetry=True) as world:
        quiet = landed(world)
    monkeypatch.setattr(Network, "idle_s", lambda *_, **__: 0.0)
    with World(state="truth", telemetry=True) as world:
        assert landed(world) == quiet
    assert "Landing detected" in quiet[1]


def test_messages_are_exchanged_at_a_known_time_without_asking_again(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = {"idle_s": 0, "exchange": 0}

    def counted(name: str) -> None:
        plain = getattr(Network, name)

        def call(*args: Any, **kwargs: Any) -> Any:
            calls[name] += 1
            return plain(*args, **kwargs)

        monkeypatch.setattr(Network, name, call)

    with World(state="truth", telemetry=None) as world:
        world.takeoff(2.0)
        world.run_for(2.0)
        counted("idle_s")
        counted("exchange")
        world.run_for(10.0)
    assert 10 <= calls["exchange"] <= 20  # heartbeats
    assert calls["idle_s"] <= calls["exchange"] + 2


def test_telemetry_of_compiled_ticks_is_recorded_at_its_time() -> None:
    with World(telemetry=True) as world:
        flown = Flown(world)
        world.takeoff(2.0)
        world.run_for(3.0)
        records = decode_records(flown.evidence().tlog)
    times = [
        (record.time_us / 1e6, message.time_boot_ms / 1e3)
        for record in records
        for message in Link(1, 1).decode(record.frame)
        if message.get_type() == "ATTITUDE"
    ]
    assert len(times) > 100
    assert all(recorded_s == pytest.approx(boot_s, abs=2e-3) for recorded_s, boot_s in times)
