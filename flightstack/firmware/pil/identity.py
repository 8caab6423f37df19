"""FS_PIL_IDENTITY of a target: compatibility with this installation, and its description. Pure."""

from __future__ import annotations

from typing import Any

from flightstack.firmware.pil.record import COST_UNITS

PROTOCOL = 4
"""Version of the FS_PIL messages; FS_APP_PROTOCOL in firmware/app/fs_app.h."""


def check_identity(identity: Any, expected_hash: bytes) -> str | None:
    """Return why the firmware of an FS_PIL_IDENTITY is incompatible, or None."""
    if identity.protocol != PROTOCOL:
        return f"its firmware speaks version {identity.protocol} of the target protocol, not {PROTOCOL}: flash it again"
    if identity.real_octets != 4:
        return (
            f"its loops compute with {8 * identity.real_octets} bits, not with 32: flash the firmware again"
        )
    if bytes(identity.source_hash) != expected_hash:
        return (
            f"its firmware was made of other sources ({bytes(identity.source_hash).hex()}, on {_board(identity)}) "
            f"than these ({expected_hash.hex()}): flash it again"
        )
    return None


def described(identity: Any) -> dict[str, Any]:
    """Return an FS_PIL_IDENTITY as a JSON object."""
    unit = identity.cost_unit
    return {
        "board": _board(identity),
        "compiler": identity.compiler.strip() or "unknown compiler",
        "source_hash": bytes(identity.source_hash).hex(),
        "cost_unit": COST_UNITS[unit] if unit < len(COST_UNITS) else f"unit {unit}",
        "clock_hz": identity.clock_hz,
        "real_octets": identity.real_octets,
        "char_bits": identity.char_bits,
        "protocol": identity.protocol,
        "window": identity.window,
        "baud": identity.baud,
        "clock_overhead": identity.clock_overhead,
    }


def _board(identity: Any) -> str:
    return identity.board.strip() or "unknown board"
