"""The signing key that a ground station was given."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flightstack.mavlink.signing import LinkSigning


def open_signing(key: Path | None) -> LinkSigning | None:
    """Return how to sign with the key in the file ``key``; raise ConfigError."""
    if key is None:
        return None
    from flightstack.process.signing_file import open_shared_signing  # noqa: PLC0415

    return open_shared_signing(key, "gcs")
