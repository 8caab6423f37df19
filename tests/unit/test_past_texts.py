"""Past status texts: kept by the vehicle, read over MAVLink FTP."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from flightstack.core.enums import Severity
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address
from flightstack.mavlink.text_file import PATH, PastText, pack_texts, read_texts
from flightstack.vehicle.journal import KEPT_TEXTS
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
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
