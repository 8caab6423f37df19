"""Message signing on the ground links, and SETUP_SIGNING, which changes the key."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from flightstack.core.enums import Severity
from flightstack.core.port_numbers import API, GROUND, is_loopback
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for
from flightstack.mavlink.signing import NO_KEY, LinkSigning, Signing
from flightstack.services.routing.peer import PeerAddress
from flightstack.vehicle.assembly import VehicleParts


class SigningSetup:
    """Changes the key, if the vehicle is disarmed and the message came over a secure link.

    ``is_secure`` returns True for a peer on such a link; on other links the key could be intercepted. While a key is
    in use, a new one must be signed with it, even on links that accept unsigned messages: a router on this machine
    makes remote messages appear local. Before ``use`` every key is refused. SETUP_SIGNING has no acknowledgement, so
    ``say`` gets a text.
    """

    handles = frozenset({"SETUP_SIGNING"})

    def __init__(
        self,
        own: Address,
        is_armed: Callable[[], bool],
        is_secure: Callable[[Hashable], bool],
        say: Callable[[str], None],
    ) -> None:
        self._own = own
        self._signing: Signing | None = None
        self._is_armed = is_armed
        self._is_secure = is_secure
        self._store: Callable[[bytes], None] = lambda _key: None
        self._say = say

    def use(self, signing: Signing, store: Callable[[bytes], None]) -> None:
        """Change the key of ``signing`` from now on. The links have checked the messages that ``receive`` gets.

        ``store`` saves the key for the next start. If it raises OSError, the old key stays.
        """
        self._signing = signing
        self._store = store

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a SETUP_SIGNING addressed to this vehicle. A broadcast is ignored: a key must not be broadcast."""
        if (
            message.get_type() not in self.handles
            or not is_for(message, self._own)
            or not message.target_system
        ):
            return
        key = bytes(message.secret_key)
        reason = self._refusal(message, peer) or self._change(key, message.initial_timestamp)
        if reason:
            self._say(f"Signing key refused: {reason}")
        else:
            self._say("Signing is off" if key == NO_KEY else "Signing is on: a new key is in use")

    def _refusal(self, message: Message, peer: Hashable) -> str:
        """Return the reason that the message may not change the key; empty if it may."""
        if self._signing is None:
            return "flightstack was started without --signing-key"
        if self._is_armed():
            return "the vehicle is armed"
        if not self._is_secure(peer):
            return "the link is not local"
        if self._signing.is_on and not message.get_header().incompat_flags & mavlink.MAVLINK_IFLAG_SIGNED:
            return "the message is not signed with the present key"
        return ""

    def _change(self, key: bytes, initial_timestamp: int) -> str:
        """Save and use the key; return the reason of a failure, or an empty text."""
        assert self._signing is not None
        try:
            self._store(key)
        except OSError as error:
            return f"it cannot be kept: {error.strerror or error}"
        self._signing.set_key(key, 0 if key == NO_KEY else initial_timestamp)
        return ""

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return nothing: the message has no acknowledgement."""
        return []

    def next_deadline(self) -> float | None:
        """Return None: there is nothing to send."""
        return None


NEVER_FORWARDED = frozenset({"SETUP_SIGNING"})
"""A key that came over a secure link must not be sent on another."""
_LINK_IDS = {GROUND: 0, API: 1}
_OTHER_LINK_ID = 2


def link_signing(signing: Signing | None, address: PeerAddress) -> LinkSigning | None:
    """Return the signing of the link to ``address``, or None. Each channel has its own link id."""
    if signing is None:
        return None
    return LinkSigning(signing, _LINK_IDS.get(address.channel, _OTHER_LINK_ID))


def signing_setup(own: Address, vehicle: VehicleParts) -> SigningSetup:
    """Return the service that takes keys from this machine, once ``use`` was called."""
    return SigningSetup(
        own,
        lambda: vehicle.now.status.armed,
        _is_on_this_machine,
        lambda text: vehicle.journal.say(Severity.NOTICE, text),
    )


def _is_on_this_machine(peer: Hashable) -> bool:
    return isinstance(peer, PeerAddress) and is_loopback(peer.host)
