"""SETUP_SIGNING: take a new signing key from a ground station, without I/O."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from flightstack.mavlink.link import Message
from flightstack.mavlink.services.addressing import Address, is_for
from flightstack.mavlink.signing import NO_KEY, Signing


class SigningSetup:
    """Changes the key of ``signing``, if the vehicle is disarmed and the message came over a secure link.

    ``is_secure`` tells so of a peer: whoever listens on the link learns the key. ``store`` keeps the key for the
    next start and may raise OSError; then the old one stays. Without ``signing`` every key is refused. The message
    has no answer: ``say`` gets a text.
    """

    handles = frozenset({"SETUP_SIGNING"})

    def __init__(
        self,
        own: Address,
        signing: Signing | None,
        is_armed: Callable[[], bool],
        is_secure: Callable[[Hashable], bool],
        store: Callable[[bytes], None],
        say: Callable[[str], None],
    ) -> None:
        self._own = own
        self._signing = signing
        self._is_armed = is_armed
        self._is_secure = is_secure
        self._store = store
        self._say = say

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a SETUP_SIGNING that is meant for this vehicle alone: the key must never be broadcast."""
        if (
            message.get_type() not in self.handles
            or not is_for(message, self._own)
            or not message.target_system
        ):
            return
        key = bytes(message.secret_key)
        reason = self._change(key, message.initial_timestamp, peer)
        if reason:
            self._say(f"Signing key refused: {reason}")
        else:
            self._say("Signing is off" if key == NO_KEY else "Signing is on: a new key is in use")

    def _change(self, key: bytes, initial_timestamp: int, peer: Hashable) -> str:
        """Use the key; return why not, empty if done."""
        if self._signing is None:
            return "flightstack was started without --signing-key"
        if self._is_armed():
            return "the vehicle is armed"
        if not self._is_secure(peer):
            return "the link is not local"
        try:
            self._store(key)
        except OSError as error:
            return f"it cannot be kept: {error.strerror or error}"
        self._signing.set_key(key, 0 if key == NO_KEY else initial_timestamp)
        return ""

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return nothing: there is no answer."""
        return []

    def next_deadline(self) -> float | None:
        """Return None: there is never anything to send."""
        return None
