"""PX4's custom modes: names, and numbers on the wire (``main << 16 | sub << 24``)."""

from __future__ import annotations

from flightstack.core.enums import CUSTOM_MODE, Mode

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


def settable_modes() -> dict[str, int]:
    """Return the custom modes that a user may select on the flight stack, by name, the automatic ones first."""
    settable = (CUSTOM_MODE[mode] for mode in Mode if mode is not Mode.TERMINATION)
    return {mode_name(number).lower(): number for number in settable}


def mode_numbers(name: str) -> tuple[int, int] | None:
    """Return PX4's main and sub mode for a name in any case; None for a mode that the flight stack does not have."""
    wanted = name.strip().upper()
    number = settable_modes().get(_ALIASES.get(wanted, wanted).lower())
    return None if number is None else (number >> 16 & 255, number >> 24)
