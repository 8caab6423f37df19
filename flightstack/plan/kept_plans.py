"""Text format for mission, geofence, rally points and home that the vehicle restores at the next start.

QGroundControl's ``.plan`` format is not suitable: it has no current item, reorders the areas of a geofence and converts
rally altitudes to relative ones, which would change plan ids and meaning.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Sequence
from typing import Any, NamedTuple

from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.plan.commands import MissionType
from flightstack.plan.item import MissionItem

VERSION = 1
_KIND = "flightstack plans"


class KeptPlans(NamedTuple):
    """The active plans."""

    mission: tuple[MissionItem, ...] = ()
    fence: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()
    current: int = 0
    """Number of the current mission item."""
    home: GeoPoint | None = None
    """Home, if set by a command; None if it is set at the next arming."""

    def items(self, kind: MissionType) -> tuple[MissionItem, ...]:
        """Return the plan of one type."""
        plans = {
            MissionType.MISSION: self.mission,
            MissionType.FENCE: self.fence,
            MissionType.RALLY: self.rally,
        }
        return plans[kind]


def plans_to_text(plans: KeptPlans) -> str:
    """Return the text of a plans file; values are not rounded."""
    content = {
        "current": plans.current,
        "fence": [_row(item) for item in plans.fence],
        "home": plans.home,
        "mission": [_row(item) for item in plans.mission],
        "rally": [_row(item) for item in plans.rally],
    }
    document = {"fileType": _KIND, "version": VERSION, "checksum": _checksum(content), "plans": content}
    return json.dumps(document) + "\n"


def plans_from_text(text: str, file: object) -> KeptPlans:
    """Parse the text of ``plans_to_text``; raise ConfigError with ``file`` as its name."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(file, "", "is damaged or truncated") from error
    if not isinstance(document, dict) or document.get("fileType") != _KIND:
        raise ConfigError(file, "", "is not a file of saved plans")
    if document.get("version") != VERSION:
        found = document.get("version")
        raise ConfigError(file, "", f"is of version {found!r:.20}, and this program reads version {VERSION}")
    content: Any = document.get("plans")
    if document.get("checksum") != _checksum(content):
        raise ConfigError(file, "", "is damaged: its checksum is wrong")
    try:
        fence, mission, rally = (tuple(map(_item, content[name])) for name in ("fence", "mission", "rally"))
        home = None if content["home"] is None else GeoPoint(*map(float, content["home"]))
        return KeptPlans(mission, fence, rally, int(content["current"]), home)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ConfigError(file, "", "is damaged") from error


def _checksum(content: object) -> int:
    return zlib.crc32(json.dumps(content, sort_keys=True).encode())


def _row(item: MissionItem) -> list[float | None]:
    floats = [None if math.isnan(value) else value for value in (*item.params, item.z)]
    return [item.command, item.frame, *floats[:4], item.x, item.y, floats[4], item.autocontinue]


def _item(row: Sequence[Any]) -> MissionItem:
    command, frame, *floats, x, y, z, autocontinue = row
    if len(floats) != 4:
        raise ValueError("an item has ten numbers")
    p1, p2, p3, p4, altitude = (math.nan if value is None else float(value) for value in (*floats, z))
    return MissionItem(int(command), int(frame), p1, p2, p3, p4, int(x), int(y), altitude, bool(autocontinue))
