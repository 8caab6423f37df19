"""Routing between peers: the table of MAVLink's routing guide, loops, and what must never be passed on."""

from __future__ import annotations

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link
from flightstack.services.routing.router import MAX_ADDRESSES, MAX_REMEMBERED, Router

OWN = Address(1, 1)
GCS, CAMERA, OTHER_VEHICLE, SECOND_GCS = Address(255, 190), Address(1, 100), Address(2, 1), Address(254, 190)
PLACES = {"udp a": GCS, "tcp b": CAMERA, "udp c": OTHER_VEHICLE, "udp d": SECOND_GCS}
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


class Net:
    """A router that has heard each of ``PLACES``."""

    def __init__(self) -> None:
        self.router = Router(OWN)
        self.now_s = 10.0
        self.senders: dict[Address, Link] = {}
        self.receiver = Link(9, 9, keeps_unknown=True)
        for peer, address in PLACES.items():
            self.send(HEARTBEAT, peer, address)

    def received(self, message, source: Address):
        sender = self.senders.setdefault(source, Link(*source))
        (received,) = self.receiver.decode(sender.encode(message))
        return received

    def send(self, message, peer: str, source: Address):
        return self.router.route(self.received(message, source), peer, self.now_s)


def ping(target: Address):
    return mavlink.MAVLink_ping_message(0, 0, *target)


@pytest.mark.parametrize(
    ("target", "local", "forward"),
    [
        ((0, 0), True, {"tcp b", "udp c", "udp d"}),
        ((1, 1), True, set()),
        ((1, 0), True, {"tcp b"}),  # all components of our system: us, and the camera
        ((1, 100), True, {"tcp b"}),
        ((1, 154), True, set()),  # a component of ours that nobody has heard
        ((2, 1), False, {"udp c"}),
        ((2, 0), False, {"udp c"}),
        ((2, 100), False, {"udp c"}),  # of a system that was heard
        ((254, 190), False, {"udp d"}),
        ((7, 1), False, set()),  # never heard: passed to nobody
        ((255, 190), False, set()),  # where it came from
    ],
)
def test_where_a_message_of_the_ground_station_goes(target, local: bool, forward: set[str]) -> None:
    route = Net().send(ping(Address(*target)), "udp a", GCS)
    assert (route.local, set(route.forward)) == (local, forward)


def test_messages_without_a_target_are_for_all() -> None:
    route = Net().send(mavlink.MAVLink_system_time_message(0, 0), "udp c", OTHER_VEHICLE)
    assert (route.local, set(route.forward)) == (True, {"udp a", "tcp b", "udp d"})


def test_an_address_at_two_peers_is_served_at_both() -> None:
    net = Net()
    net.send(HEARTBEAT, "udp e", GCS)
    assert set(net.send(ping(GCS), "udp c", OTHER_VEHICLE).forward) == {"udp a", "udp e"}
    assert set(net.send(ping(GCS), "udp e", SECOND_GCS).forward) == {"udp a"}


def test_a_peer_that_was_not_heard_gets_nothing_and_one_that_is_gone_no_more() -> None:
    net = Net()
    assert "stranger" not in net.send(HEARTBEAT, "udp a", GCS).forward
    net.router.forget("tcp b")
    assert "tcp b" not in net.send(HEARTBEAT, "udp a", GCS).forward
    assert net.send(ping(CAMERA), "udp a", GCS).forward == ()


def test_our_own_words_are_not_passed_on_nor_learned() -> None:
    net = Net()
    assert net.send(HEARTBEAT, "udp a", OWN).forward == ()
    assert net.send(ping(OWN), "udp c", OTHER_VEHICLE).forward == ()


@pytest.mark.parametrize(
    "message",
    [
        mavlink.MAVLink_setup_signing_message(0, 0, b"k" * 32, 0),
        mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7),
    ],
    ids=lambda message: message.get_type(),
)
def test_keys_and_reports_of_a_radio_stay_on_their_link(message) -> None:
    assert Net().send(message, "udp a", GCS).forward == ()


def test_a_ring_of_links_does_not_multiply_a_message() -> None:
    """A frame that comes back over another link is not passed on again, and neither over a third."""
    net = Net()
    received = net.received(HEARTBEAT, GCS)
    assert len(net.router.route(received, "udp a", 10.0).forward) == 3
    for peer in ("tcp b", "udp c"):
        assert net.router.route(received, peer, 10.1).forward == ()
    assert net.router.repetitions == 2
    assert len(net.router.route(received, "tcp b", 12.0).forward) == 3  # not an echo any more


def test_a_sender_may_repeat_itself() -> None:
    net = Net()
    received = net.received(HEARTBEAT, GCS)
    assert len(net.router.route(received, "udp a", 10.0).forward) == 3
    assert len(net.router.route(received, "udp a", 10.1).forward) == 3


def test_unknown_messages_are_passed_on_to_all_but_only_from_a_peer_with_good_standing() -> None:
    net = Net()
    frame = bytes([0xFD, 2, 0, 0, 5, 77, 8]) + (54321).to_bytes(3, "little") + b"\x01\x02\x11\x22"
    (unknown,) = net.receiver.decode(frame)
    route = net.router.route(unknown, "udp a", 10.0)
    assert (route.local, set(route.forward)) == (False, {"tcp b", "udp c", "udp d"})
    assert net.router.route(unknown, "stranger", 20.0).forward == ()
    assert net.send(ping(Address(77, 8)), "udp c", OTHER_VEHICLE).forward == ()  # learned nothing from it


def test_a_liar_about_its_address_fills_no_memory_and_displaces_nobody() -> None:
    net = Net()
    for number in range(3000):
        source = Address(10 + number % 200, 1 + number // 200)
        net.router.route(net.received(HEARTBEAT, source), "liar", 10.0)
    assert len(net.router.addresses_of("liar")) == MAX_ADDRESSES
    assert net.router.remembered == MAX_REMEMBERED
    assert net.send(ping(CAMERA), "udp a", GCS).forward == ("tcp b",)
