"""QGroundControl's ``.plan``: JSON, version 1. Objects of unchanged items are written back as they were read.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. A DO_JUMP in the file refers to
the ``doJumpId`` of its target; in memory, as in MAVLink, to the number of the target.
"""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.plan import values
from flightstack.plan.commands import SCALED_FRAMES, Command
from flightstack.plan.item import MissionItem, Plan, float_coordinate
from flightstack.plan.qgc_areas import fence_document, fence_items, rally_document, rally_items


class _Entry(NamedTuple):
    where: str
    item: MissionItem
    jump_id: int | None


def read_plan(text: str, file: object) -> Plan:
    """Parse a ``.plan``; raise ConfigError with ``file`` as its name."""
    return plan_of_document(_document(text, file), file)


def plan_of_document(document: Mapping[str, Any], file: object) -> Plan:
    """Return the plan of a JSON document of the right type and version."""
    mission = document.get("mission")
    if not isinstance(mission, dict):
        raise ConfigError(file, "mission", "must be an object with the mission's items")
    listed = mission.get("items")
    if not isinstance(listed, list):
        raise ConfigError(file, "mission.items", "must be a list")
    values.check_count(file, len(listed))
    entries: list[_Entry] = []
    for listed_item in listed:
        _append(entries, listed_item, file)
    values.check_count(file, len(entries))
    home = _home(mission.get("plannedHomePosition"), file)
    items = _with_jump_targets(entries, file)
    return Plan(items, home, document, fence=fence_items(document, file), rally=rally_items(document, file))


def _document(text: str, file: object) -> dict[str, Any]:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError also for an integer of thousands of digits
        raise ConfigError(file, "", f"is not valid JSON: {error}") from error
    if not isinstance(document, dict) or document.get("fileType") != "Plan":
        found = document.get("fileType") if isinstance(document, dict) else None
        raise ConfigError(file, "fileType", f"{found!r:.40} must be 'Plan'")
    if document.get("version") != 1:
        raise ConfigError(file, "version", f"{document.get('version')!r:.40} must be 1")
    return document


def _append(entries: list[_Entry], listed: Any, file: object) -> None:
    """Append a simple item, or the simple items of a complex item such as a survey."""
    where = f"item {len(entries)}"
    if not isinstance(listed, dict):
        raise ConfigError(file, where, "must be an object")
    kind = listed.get("type")
    if kind == "SimpleItem":
        entries.append(_simple_item(listed, where, file))
        return
    if kind != "ComplexItem":
        raise ConfigError(file, f"{where}, type", f"{kind!r:.40} must be 'SimpleItem' or 'ComplexItem'")
    transect = listed.get("TransectStyleComplexItem")
    inner = transect.get("Items") if isinstance(transect, dict) else None
    if not isinstance(inner, list):
        name = listed.get("complexItemType")
        problem = f"the complex item {name!r:.40} has no list of simple items; convert it to waypoints"
        raise ConfigError(file, where, problem)
    values.check_count(file, len(entries) + len(inner))
    for simple in inner:
        if not isinstance(simple, dict):
            raise ConfigError(file, f"item {len(entries)}", "must be an object")
        entries.append(_simple_item(simple, f"item {len(entries)}", file))


def _simple_item(listed: dict[str, Any], where: str, file: object) -> _Entry:
    code = values.command(file, f"{where}, command", listed.get("command"))
    frame = values.frame(file, f"{where}, frame", listed.get("frame"))
    params = listed.get("params")
    if not isinstance(params, list) or len(params) != 7:
        raise ConfigError(file, f"{where}, params", "must be a list of 7 numbers")
    is_global = frame in SCALED_FRAMES
    numbers = [
        values.number(file, f"{where}, {values.field_name(index, is_global)}", value)
        for index, value in enumerate(params)
    ]
    autocontinue = listed.get("autoContinue", True)
    if not isinstance(autocontinue, bool):
        raise ConfigError(file, f"{where}, autoContinue", f"{autocontinue!r:.40} must be true or false")
    jump_id = listed.get("doJumpId")
    if jump_id is not None:
        jump_id = values.integer(file, f"{where}, doJumpId", jump_id, 2**31 - 1)
    item = values.mission_item(file, where, code, frame, numbers, autocontinue=autocontinue)
    return _Entry(where, item, jump_id)


def _with_jump_targets(entries: list[_Entry], file: object) -> tuple[MissionItem, ...]:
    seq_by_id: dict[float, int] = {}
    for seq, entry in enumerate(entries):
        if entry.jump_id is not None:
            seq_by_id.setdefault(entry.jump_id, seq)
    items = []
    for where, item, _ in entries:
        target = item
        if item.command == Command.DO_JUMP:
            if item.param1 not in seq_by_id:
                problem = f"jumps to doJumpId {item.param1:g}, which no item has"
                raise ConfigError(file, f"{where}, param 1", problem)
            target = replace(item, param1=float(seq_by_id[item.param1]))
        items.append(target)
    return tuple(items)


def _home(value: Any, file: object) -> GeoPoint | None:
    key = "mission.plannedHomePosition"
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 3:
        raise ConfigError(file, key, "must be a list of latitude, longitude and altitude")
    return values.home_position(file, key, [values.number(file, key, part) for part in value])


def plan_to_json(plan: Plan) -> str:
    """Return the text of a ``.plan``."""
    document = copy.deepcopy(dict(plan.document)) or _empty_document()
    source = plan_of_document(document, "")
    mission = document["mission"]
    if source.items != plan.items:
        listed = _simple_items(mission["items"])
        mission["items"] = [
            _kept(listed[seq], item, seq) if item in source.items[seq : seq + 1] else _fresh(item, seq)
            for seq, item in enumerate(plan.items)
        ]
    if source.home is None or source.home != plan.home:
        mission["plannedHomePosition"] = [_number(value) for value in plan.home or _derived_home(plan)]
    if source.fence != plan.fence:
        document["geoFence"] = fence_document(plan.fence, document.get("geoFence") or {})
    if source.rally != plan.rally:
        document["rallyPoints"] = rally_document(plan.rally, plan.home, document.get("rallyPoints") or {})
    return json.dumps(document, indent=4) + "\n"


def _empty_document() -> dict[str, Any]:
    """Return a plan without items: firmware PX4 (12), vehicle quadrotor (2)."""
    return {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "groundStation": "flightstack",
        "mission": {
            "cruiseSpeed": 15,
            "firmwareType": 12,
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": 5,
            "items": [],
            "plannedHomePosition": None,
            "vehicleType": 2,
            "version": 2,
        },
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }


def _simple_items(listed: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return one object per item, with complex items expanded."""
    flat: list[dict[str, Any]] = []
    for entry in listed:
        flat += entry["TransectStyleComplexItem"]["Items"] if entry["type"] == "ComplexItem" else [entry]
    return flat


def _kept(listed: dict[str, Any], item: MissionItem, seq: int) -> dict[str, Any]:
    """Return the object of an unchanged item with updated ids."""
    params = list(listed["params"])
    if item.command == Command.DO_JUMP:
        params[0] = _number(item.param1 + 1.0)
    return {**listed, "doJumpId": seq + 1, "params": params}


def _fresh(item: MissionItem, seq: int) -> dict[str, Any]:
    shift = 1.0 if item.command == Command.DO_JUMP else 0.0  # from number to doJumpId
    params = (
        item.param1 + shift, item.param2, item.param3, item.param4,
        float_coordinate(item.x, item.is_global), float_coordinate(item.y, item.is_global), item.z,
    )  # fmt: skip
    return {
        "autoContinue": item.autocontinue,
        "command": item.command,
        "doJumpId": seq + 1,
        "frame": item.frame,
        "params": [_number(value) for value in params],
        "type": "SimpleItem",
    }


def _number(value: float) -> float | int | None:
    if not math.isfinite(value):
        return None
    return int(value) if value.is_integer() and abs(value) < 1e15 else value


def _derived_home(plan: Plan) -> GeoPoint:
    """Return a home for a plan without one: QGroundControl requires it."""
    positions = (item.position_deg for item in plan.items)
    latitude_deg, longitude_deg = next((position for position in positions if position), (0.0, 0.0))
    return GeoPoint(latitude_deg, longitude_deg, 0.0)
