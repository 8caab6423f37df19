"""Plan files of all formats, and what a format cannot hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.errors import ConfigError, WriteError
from flightstack.plan import Plan
from flightstack.plan.files import PLAN_SUFFIXES, WAYPOINTS_SUFFIXES, plan_of_text, read_text
from flightstack.plan.qgc_plan import plan_to_json
from flightstack.plan.waypoints import plan_to_waypoints
from gcs_cli.plans.compare import differences
from gcs_cli.plans.formats.features import features_of_plan, plan_of_features
from gcs_cli.plans.formats.geojson import is_geojson, read_geojson, render_geojson
from gcs_cli.plans.formats.gpx import read_gpx, render_gpx
from gcs_cli.plans.formats.kml import read_kml, render_kml
from gcs_cli.plans.names import any_command_name

DEFAULT_ALTITUDE_M = 5.0
"""Altitude above home of points that have none."""
SUFFIXES = (*PLAN_SUFFIXES, *WAYPOINTS_SUFFIXES, ".kml", ".gpx", ".geojson")


def load_any(path: Path, altitude_m: float = DEFAULT_ALTITUDE_M) -> Plan:
    """Read a plan of any format; points without an altitude get ``altitude_m`` above home. Raise ConfigError."""
    return _plan(read_text(path), path, altitude_m)


def _plan(text: str, path: Path, altitude_m: float) -> Plan:
    suffix = path.suffix.lower()
    if suffix == ".kml":
        return plan_of_features(read_kml(text, path), altitude_m, path)
    if suffix == ".gpx":
        return plan_of_features(read_gpx(text, path), altitude_m, path)
    if suffix == ".geojson" or (suffix == ".json" and is_geojson(text)):
        return plan_of_features(read_geojson(text, path), altitude_m, path)
    return plan_of_text(text, path, SUFFIXES)


def save_any(path: Path, plan: Plan) -> str:
    """Write ``plan`` atomically in the format of the suffix; return what the format lost, or an empty text.

    Raise ConfigError for an unknown suffix, WriteError for a file that cannot be written.
    """
    text = _text(path, plan)
    after = _plan(text, path, DEFAULT_ALTITUDE_M)
    try:
        write_text_atomically(path, text)
    except (OSError, ValueError) as error:
        problem = error.strerror if isinstance(error, OSError) else error
        raise WriteError(path, "", f"cannot be written: {problem}") from error
    return ", ".join(_losses(plan, after))


def check_suffix(path: Path) -> None:
    """Raise ConfigError for a suffix of no format."""
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigError(path, "", f"the suffix {path.suffix!r} must be one of {', '.join(SUFFIXES)}")


def _text(path: Path, plan: Plan) -> str:
    check_suffix(path)
    suffix = path.suffix.lower()
    if suffix == ".kml":
        return render_kml(features_of_plan(plan))
    if suffix == ".gpx":
        return render_gpx(plan)
    if suffix == ".geojson":
        return render_geojson(features_of_plan(plan))
    if suffix in PLAN_SUFFIXES:
        return plan_to_json(plan)
    return plan_to_waypoints(replace(plan, fence=(), rally=(), document={}), path)


def _losses(before: Plan, after: Plan) -> Iterator[str]:
    """Yield what a written plan lacks when it is read again."""
    items = before.items
    if len(after.items) != len(items):
        lost = [item for item in items if item.position_deg is None]
        names = ", ".join(sorted({any_command_name(item.command) for item in lost}))
        yield f"{len(lost)} items without a position ({names})"
        items = tuple(item for item in items if item.position_deg is not None)
    fields = dict.fromkeys(difference.field for difference in differences(items, after.items))
    if "frame" in fields and "altitude" in fields:
        del fields["altitude"]
    names_of = {"frame": "altitudes above home (now above sea level)", "item": "items"}
    yield from (names_of.get(field, field) for field in fields)
    if any(differences(before.fence, after.fence)):
        yield f"the geofence of {len(before.fence)} items"
    if before.rally and len(after.rally) != len(before.rally):
        yield f"{len(before.rally)} rally points"
    if before.home is not None and after.home != before.home:
        yield "the home position"
    if before.comments and not after.comments:
        yield "comments"
    listed = before.document.get("mission", {}).get("items", []) if before.document else []
    if not after.document and any(entry.get("type") == "ComplexItem" for entry in listed):
        yield "the settings of its surveys"
