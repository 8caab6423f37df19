"""Write a ``.plan``: what the source document says about unchanged items is kept to the letter."""

from __future__ import annotations

import copy
import json
import math
from typing import Any

from flightstack.core.geodesy import GeoPoint
from flightstack.plan.item import MissionItem, float_coordinate
from flightstack.plan.plan import Plan
from flightstack.plan.qgc_areas import fence_document, rally_document
from flightstack.plan.qgc_plan import plan_of_document
from flightstack.plan.vocabulary import Command


def plan_to_json(plan: Plan) -> str:
    """Return the text of a ``.plan`` that QGroundControl opens."""
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
    """Return one object per item, those of complex items in their place."""
    flat: list[dict[str, Any]] = []
    for entry in listed:
        flat += entry["TransectStyleComplexItem"]["Items"] if entry["type"] == "ComplexItem" else [entry]
    return flat


def _kept(listed: dict[str, Any], item: MissionItem, seq: int) -> dict[str, Any]:
    """Return the object of an unchanged item, with the ids of its new surroundings."""
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
    """Return a home where none is known: QGroundControl opens no plan without one."""
    positions = (item.position_deg for item in plan.items)
    latitude_deg, longitude_deg = next((position for position in positions if position), (0.0, 0.0))
    return GeoPoint(latitude_deg, longitude_deg, 0.0)
