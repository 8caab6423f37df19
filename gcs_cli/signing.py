"""The signing key that a ground station was given."""

from __future__ import annotations

import secrets
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flightstack.mavlink.signing import LinkSigning


def open_signing(key: Path | None) -> LinkSigning | None:
    """Return how to sign with the key in the file ``key``; raise ConfigError.

    Each run takes a link id of its own, so that two of them at once are two streams to the vehicle.
    """
    if key is None:
        return None
    from flightstack import signing_file  # noqa: PLC0415
    from flightstack.mavlink.signing import LinkSigning  # noqa: PLC0415

    return LinkSigning(signing_file.open_signing(key, "gcs"), secrets.randbelow(256))
