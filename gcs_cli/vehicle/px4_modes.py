"""PX4's custom modes: names, and numbers on the wire (``main << 16 | sub << 24``)."""

from __future__ import annotations

_AUTO = 4

_MAIN_NAMES = {
    1: "MANUAL",
    2: "ALTITUDE",
    3: "POSITION",
    4: "AUTO",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
    9: "SIMPLE",
    10: "TERMINATION",
}

_AUTO_NAMES = {
    1: "READY",
    2: "TAKEOFF",
    3: "HOLD",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    8: "FOLLOW",
    9: "PRECLAND",
}

_ALIASES = {"LOITER": "HOLD", "RETURN": "RTL", "POSCTL": "POSITION", "ALTCTL": "ALTITUDE"}


def mode_name(custom_mode: int) -> str:
    """Return the name of a PX4 custom mode; an unknown one is shown by its two numbers."""
    main, sub = custom_mode >> 16 & 255, custom_mode >> 24 & 255
    if main == _AUTO and sub in _AUTO_NAMES:
        return _AUTO_NAMES[sub]
    if main in _MAIN_NAMES and main != _AUTO:
        return _MAIN_NAMES[main]
    return f"mode {main}.{sub}"


def mode_numbers(name: str) -> tuple[int, int] | None:
    """Return PX4's main and sub mode for a name, in any case; None for an unknown mode."""
    wanted = _ALIASES.get(name.strip().upper(), name.strip().upper())
    for sub, known in _AUTO_NAMES.items():
        if known == wanted:
            return _AUTO, sub
    for main, known in _MAIN_NAMES.items():
        if known == wanted and main != _AUTO:
            return main, 0
    return None


def settable_modes() -> list[str]:
    """Return the names for ``gcs mode``, the automatic modes first."""
    return [*_AUTO_NAMES.values(), *(name for main, name in _MAIN_NAMES.items() if main != _AUTO)]
