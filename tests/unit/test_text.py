"""Texts from a link: whatever they hold, one printable line is left."""

from __future__ import annotations

import unicodedata

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import clean
from flightstack.mavlink.files import FileTree, fixed
from flightstack.mavlink.link import Link, Message
from flightstack.services.files.ftp_server import FtpServer
from flightstack.transports.udp import Address
from gcs_cli.clients.ftp_client import FtpClient, FtpDone
from gcs_cli.link.session import Session
from gcs_cli.transfers.log_calls import is_plain_name
from gcs_cli.tui.watch_lines import text_line
from tests.fuzz.clients import OWN, VEHICLE

PEER: Address = ("192.0.2.1", 18570)
HOSTILE = st.text(
    st.sampled_from("\x1b\x00\x07\x7f\x85\x9b\t\r\n\u061c\u200b\u200e\u202e\u2028\u2066\ufeff[]mA1;")
    | st.characters(),
    max_size=60,
)
OBEYED = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Categories of control characters, marks of text direction, surrogates and line ends."""


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Takeoff detected\t", "Takeoff detected "),
        ("two\nlines\r\n", "two lines  "),
        ("\x1b[31mred\x9b0m", "�[31mred�0m"),
        ("\u202etxt.exe", "�txt.exe"),
        ("5 °C, αβγ 日本", "5 °C, αβγ 日本"),
        ("", ""),
    ],
)
def test_a_text_is_shown_on_one_line(text: str, shown: str) -> None:
    assert clean(text) == shown


@settings(max_examples=500)
@given(HOSTILE)
def test_a_clean_text_holds_nothing_that_a_terminal_obeys(text: str) -> None:
    shown = clean(text)
    assert not {unicodedata.category(c) for c in shown} & OBEYED
    assert shown.isprintable()
    assert clean(shown) == shown


@given(st.binary(max_size=16))
def test_every_text_field_of_a_message_is_clean(octets: bytes) -> None:
    for message in (
        mavlink.MAVLink_param_value_message(octets, 1.0, 9, 1, 0),
        mavlink.MAVLink_param_error_message(255, 190, octets, 0, 1),
        mavlink.MAVLink_component_metadata_message(0, 0, octets),
    ):
        (received,) = Link(255, 190).decode(Link(1, 1).encode(message))
        texts = [value for value in received.to_dict().values() if isinstance(value, str)]
        assert len(texts) >= 2  # the name of the message is one
        assert all(text.isprintable() for text in texts)


def test_forwarded_message_keeps_its_bytes() -> None:
    frame = Link(1, 1).encode(mavlink.MAVLink_param_value_message(b"\x1b[2J", 1.0, 9, 1, 0))
    (received,) = Link(255, 190).decode(frame)
    assert bytes(received.get_msgbuf()) == frame


@given(HOSTILE)
def test_a_status_text_is_shown_on_one_line(text: str) -> None:
    session, vehicle = Session(), Link(1, 1)
    session.receive(vehicle.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)), PEER, 0.0)
    octets = text.encode(errors="surrogatepass")[:50]
    session.receive(vehicle.encode(mavlink.MAVLink_statustext_message(4, octets, 0, 0)), PEER, 0.0)
    (entry,) = session.view.texts
    assert text_line(entry).isprintable()


@given(HOSTILE.filter(lambda name: name.strip("./") and not set(name) & {"/", "\0"}))
def test_a_listed_file_has_a_clean_name(name: str) -> None:
    name = name.encode(errors="replace").decode()
    client, server = FtpClient(VEHICLE, OWN), FtpServer(VEHICLE, FileTree({name: fixed(b"x")}, {}))
    client.start_list("/")
    for step in range(10):
        for request in client.poll(0.1 * step):
            server.receive(carried(request, Link(*OWN)), "gcs", 0.1 * step)
        for _, answer in server.poll(0.1 * step):
            client.receive(carried(answer, Link(*VEHICLE)), 0.1 * step)
    assert isinstance(client.result, FtpDone)
    assert all(entry.name.isprintable() for entry in client.result.entries)


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "../x.ulg", "a/b", "a\\b", ".bashrc", "C:x", "a\x1b.ulg", clean("a\x1b.ulg"), "a\nb"],
)
def test_a_name_that_leads_elsewhere_names_no_file(name: str) -> None:
    assert not is_plain_name(name)


def carried(message: Message, sender: Link) -> Message:
    (received,) = Link(0, 0).decode(sender.encode(message))
    return received
