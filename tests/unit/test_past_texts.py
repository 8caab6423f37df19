"""Past status texts: kept by the vehicle, read over MAVLink FTP."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core.enums import Severity
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address
from flightstack.mavlink.text_file import PATH, PastText, pack_texts, read_texts
from flightstack.vehicle.flight_state import KEPT_TEXTS
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
from gcs_cli.commands.messages import TextPrinter
from gcs_cli.link.connection import Connection
from gcs_cli.link.endpoint import parse_endpoint
from gcs_cli.output import Output
from gcs_cli.transfers.past_texts import texts_before
from gcs_cli.vehicle.view_types import Identity, StatusText, VehicleView
from tests.support.hub_net import ACCEPTED, ALICE, DENIED, Net

REQUEST, REACHED = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED


def test_texts_survive_the_file() -> None:
    texts = (PastText(0.25, 6, "Takeoff detected"), PastText(1234.5, 0, "Ω\tfalls"))
    assert read_texts(pack_texts(texts)) == (texts[0], texts[1]._replace(text="Ω falls"))


@given(st.binary() | st.text().map(str.encode))
def test_any_content_gives_printable_texts(content: bytes) -> None:
    for entry in read_texts(content + b"\n1.0\t4\tok\n"):
        assert entry.text.isprintable()


def test_vehicle_keeps_texts_for_a_client_that_connects_later() -> None:
    net = Net()
    first = net.join(ALICE)
    for number in range(KEPT_TEXTS + 5):
        net.stack.journal.say(Severity.INFO, f"text {number}")
    net.run(0.1)
    assert len(first.take("STATUSTEXT")) == KEPT_TEXTS + 5
    client = FtpClient(Address(7, 1), Address(255, 190))
    client.start_download(PATH)
    while client.result is None:
        for message in client.poll(net.now_s):
            first.send(message)
        net.run(0.01)
        for message in first.take("FILE_TRANSFER_PROTOCOL"):
            client.receive(message, net.now_s)
    assert isinstance(client.result, FtpDone)
    texts = read_texts(client.result.content)
    assert [entry.text for entry in texts] == [f"text {number}" for number in range(5, KEPT_TEXTS + 5)]
    assert first.take("STATUSTEXT") == []


def test_reached_item_is_repeated_on_request() -> None:
    net = Net()
    station = net.join(ALICE)
    net.poll()
    assert station.ask(REQUEST, REACHED) == DENIED
    net.stack.now.progress = net.stack.now.progress._replace(reached=3)
    assert station.ask(REQUEST, REACHED) == ACCEPTED
    assert [message.seq for message in station.take("MISSION_ITEM_REACHED")] == [3]


def live_text(text: str, time_s: float | None) -> StatusText:
    return StatusText(0, 6, text, 0.0, time_s)


def test_text_that_was_received_is_not_a_past_one() -> None:
    past = [PastText(1.0, 6, "a"), PastText(2.0, 6, "b"), PastText(3.0, 6, "c")]
    assert texts_before(past, [live_text("b", 2.1), live_text("c", None), live_text("d", 3.1)]) == past[:1]


def test_repeated_text_is_received_as_often_as_it_was_sent() -> None:
    past = [PastText(time_s, 6, "again") for time_s in (100.0, 101.0, 102.0)]
    assert texts_before(past, [live_text("again", 101.5)]) == past[:2]


def test_text_that_is_sent_again_later_stays_a_past_one() -> None:
    past = [PastText(100.0, 6, "Low battery")]
    assert texts_before(past, [live_text("Low battery", 160.0)]) == past
    assert texts_before(past, [live_text("Low battery", 100.0)._replace(severity=4)]) == past


def test_texts_received_while_the_file_is_read_are_all_printed(capsys: pytest.CaptureFixture[str]) -> None:
    past = [PastText(float(number), 6, f"text {number}") for number in range(5)]
    live = [live_text(f"text {number}", float(number))._replace(number=number - 2) for number in (2, 3, 4, 5)]
    with Connection(parse_endpoint("udpout:127.0.0.1:1")) as connection:
        session = connection.fleet.sessions.setdefault(1, connection.session)
        session.view = VehicleView(identity=Identity(1, 1, 2, 12), texts=tuple(live), text_count=4)
        printer = TextPrinter(connection, Output(as_json=False), 7, None)
        printer.print_past(past, 1)
        printer.print_new()
    assert capsys.readouterr().out == "".join(f"{n}.0 s  info: text {n}\n" for n in range(1, 6))
