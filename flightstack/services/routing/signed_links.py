"""How the vehicle's ground links are signed, and who may change the key."""

from __future__ import annotations

from collections.abc import Hashable

from flightstack.core.enums import Severity
from flightstack.core.port_numbers import API, GROUND, is_loopback
from flightstack.mavlink.link import Address
from flightstack.mavlink.signing import LinkSigning, Signing
from flightstack.services.routing.peer import PeerAddress
from flightstack.services.routing.signing_setup import SigningSetup
from flightstack.vehicle.assembly import VehicleParts

NEVER_FORWARDED = frozenset({"SETUP_SIGNING"})
"""A key that came over a safe link must not go out on another."""
_LINK_IDS = {GROUND: 0, API: 1}
_OTHER_LINK_ID = 2


def link_signing(signing: Signing | None, address: PeerAddress) -> LinkSigning | None:
    """Return how to sign the link to ``address``; each channel has a link id of its own."""
    if signing is None:
        return None
    return LinkSigning(signing, _LINK_IDS.get(address.channel, _OTHER_LINK_ID))


def signing_setup(own: Address, vehicle: VehicleParts) -> SigningSetup:
    """Return the service that refuses new keys until it is to ``use`` a signing, from this machine then."""
    return SigningSetup(
        own,
        lambda: vehicle.now.status.armed,
        _is_on_this_machine,
        lambda text: vehicle.journal.say(Severity.NOTICE, text),
    )


def _is_on_this_machine(peer: Hashable) -> bool:
    return isinstance(peer, PeerAddress) and is_loopback(peer.host)
