"""Whether the other side of a link is still there."""

from __future__ import annotations


class PeerMonitor:
    """Remembers when a peer was last heard, by the clock of whoever asks."""

    def __init__(self, timeout_s: float) -> None:
        self.timeout_s = timeout_s
        self.last_heard_s: float | None = None

    def heard(self, now_s: float) -> None:
        """Note a message from the peer."""
        self.last_heard_s = now_s

    def is_alive(self, now_s: float) -> bool:
        """Tell whether the peer was heard within the timeout; never heard is not alive."""
        return self.last_heard_s is not None and now_s - self.last_heard_s < self.timeout_s

    def is_lost(self, now_s: float) -> bool:
        """Tell whether the peer was heard once and is silent now."""
        return self.last_heard_s is not None and not self.is_alive(now_s)

    def next_deadline(self) -> float | None:
        """Return when the peer counts as lost, if it stays silent; None before it was heard."""
        return None if self.last_heard_s is None else self.last_heard_s + self.timeout_s
