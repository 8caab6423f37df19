"""The ground station's session, its view of the vehicle and its clients, against whatever arrives."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from gcs_cli.link.session import Service, Session
from gcs_cli.tui.palette import DARK
from gcs_cli.tui.watch_lines import state_line, text_line
from tests.fuzz.clients import SERVICES
from tests.fuzz.inputs import KINDS, Inputs
from tests.fuzz.measure import calls, held
from tests.support.view_panels import PANELS

MESSAGES = 1_000
STEP_S = 0.02
HERE = ("192.0.2.1", 18570)
MOST_HELD = 400_000
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)
LONG = [b"\xfd" * 65_000, b"\xfe" * 65_000, b"\xfe\x00" * 30_000, b"\xfd\xff\x00" * 20_000]


def show(session: Session, now_s: float) -> None:
    """Draw and write the view, at all three sizes; no control character comes out."""
    for width, height in ((20, 4), (46, 12), (90, 30)):
        for panel in PANELS:
            lines = panel(session.view, now_s, width, height, DARK)
            assert all(line.plain.isprintable() for line in lines)
    assert state_line(session.view, now_s).isprintable()
    assert all(text_line(text).isprintable() for text in session.view.texts)


@pytest.mark.parametrize("make", SERVICES)
def test_every_client_lives_with_a_mad_vehicle_and_comes_to_an_end(make: Callable[[], Service]) -> None:
    """The vehicle says anything, then falls silent: the operation under way ends, well or not."""
    session, vehicle, record = Session(), Link(1, 1), [0]

    def note(frame: bytes) -> None:
        record[0] += len(frame)

    session.record = note
    session.receive(vehicle.encode(HEARTBEAT), HERE, 0.0)
    service = make()
    session.use(service)
    inputs = Inputs(81 + SERVICES.index(make), targets=(0, 255, 255), sources=(1, 1, 1, 2))
    now_s = 0.0
    for number in range(MESSAGES):
        now_s += STEP_S if number % 10 == 0 else 0.0
        for piece in inputs.pieces(inputs.datagram()):
            session.receive(piece, (HERE[0], HERE[1] + (number % 50) * (number % 7 == 0)), now_s)
        assert len(session.poll(now_s)) < 200
        if number % 250 == 0:
            show(session, now_s)
    assert record[0] > 0
    assert held(session) < MOST_HELD
    while getattr(service, "result", None) is None and now_s < 600.0:
        now_s += 0.5
        session.poll(now_s)
    assert getattr(service, "result", None) is not None


def test_a_real_vehicle_is_found_after_anything() -> None:
    """Strangers that claim to be vehicles fall silent at last; the next heartbeat decides."""
    session, inputs = Session(), Inputs(101)
    for number in range(MESSAGES):
        session.receive(inputs.datagram(), (HERE[0], number % 300), number * 0.001)
    assert len(inputs.drawn) > len(KINDS) // 2
    session.receive(Link(42, 1).encode(HEARTBEAT), HERE, 1_000.0)
    assert (session.target, session.peer) == ((42, 1), HERE)


@pytest.mark.parametrize("data", LONG, ids=["v2", "v1", "short v1", "long v2"])
def test_the_work_is_bounded_by_the_size_of_what_arrives(data: bytes) -> None:
    session = Session()
    assert calls(lambda: session.receive(data, HERE, 0.0)) < 20 * len(data)
    assert session.view.identity is None
