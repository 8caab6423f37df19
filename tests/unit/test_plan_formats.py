"""Plans in KML, GPX and GeoJSON: round trips, files of other programs, losses, and damaged files."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.plan import Command, Frame, MissionItem, Plan, load_plan
from gcs_cli.errors import CliError
from gcs_cli.plans.compare import differences
from gcs_cli.plans.formats import libraries
from gcs_cli.plans.formats.features import features_of_plan, plan_of_features
from gcs_cli.plans.formats.files import load_any, save_any
from gcs_cli.plans.formats.geojson import read_geojson, render_geojson
from gcs_cli.plans.formats.kml import read_kml, render_kml
from tests.support.plan_items import HOME, circle, polygon, rally_point, return_point, square
from tests.support.random_plans import plans

EXAMPLES = ["square.plan", "every_item.plan", "fenced_square.plan", "triangle.waypoints"]
KML = """<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><name>field</name><Polygon>
<outerBoundaryIs><LinearRing><coordinates>8.5,47.4 8.51,47.4 8.51,47.41 8.5,47.4</coordinates></LinearRing>
</outerBoundaryIs></Polygon></Placemark><Folder><Placemark><LineString><altitudeMode>relativeToGround</altitudeMode>
<coordinates>8.5,47.4,12 8.6,47.5,14</coordinates></LineString></Placemark></Folder></Document></kml>"""
GPX = """<gpx version="1.1" creator="watch"><trk><trkseg><trkpt lat="47.4" lon="8.5"><ele>500</ele></trkpt>
<trkpt lat="47.41" lon="8.51"/></trkseg></trk></gpx>"""


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(plan=plans())
def test_geojson_and_kml_lose_nothing_of_a_plan(plan: Plan) -> None:
    wide = [(0.0, 0.0), (0.0, 90.0), (80.0, 30.0)]
    fence = (*polygon(square(100.0)), circle((3.0, 2.0), 12.5, inclusion=False), return_point((1.0, 1.0)))
    plan = replace(plan, fence=fence, rally=(rally_point(wide[0], 4.5), rally_point((5.0, 6.0), 0.25)))
    for features in (
        read_geojson(render_geojson(features_of_plan(plan)), "a"),
        read_kml(render_kml(features_of_plan(plan)), "a"),
    ):
        after = plan_of_features(features, 5.0, "a")
        assert after.items == plan.items
        assert (after.fence, after.rally, after.home) == (plan.fence, plan.rally, plan.home)


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("suffix", [".plan", ".kml", ".geojson"])
def test_example_plans_convert_without_loss(tmp_path: Path, name: str, suffix: str) -> None:
    plan = load_plan(f"missions/{name}")
    path = tmp_path / f"copy{suffix}"
    assert save_any(path, plan) in ("", "comments")
    after = load_any(path)
    assert (after.items, after.fence, after.rally, after.home) == (
        plan.items,
        plan.fence,
        plan.rally,
        plan.home,
    )


def test_gpx_keeps_places_and_names_its_losses(tmp_path: Path) -> None:
    plan = load_plan("missions/every_item.plan")
    path = tmp_path / "route.gpx"
    lost = save_any(path, plan)
    assert "items without a position (" in lost
    assert "DO_JUMP" in lost
    assert "altitudes above home (now above sea level)" in lost
    after = load_any(path)
    assert [item.position_deg for item in after.items] == [
        item.position_deg for item in plan.items if item.position_deg is not None
    ]
    assert after.home == plan.home
    assert {item.frame for item in after.items if not math.isnan(item.z)} <= {
        Frame.GLOBAL,
        Frame.GLOBAL_RELATIVE_ALT,
    }


def test_waypoint_files_lose_geofence_and_rally_points(tmp_path: Path) -> None:
    lost = save_any(tmp_path / "a.waypoints", load_plan("missions/fenced_square.plan"))
    assert lost == "the geofence of 5 items, 1 rally points"


def test_kml_of_other_programs_gives_waypoints_and_a_geofence(tmp_path: Path) -> None:
    path = tmp_path / "earth.kml"
    path.write_text(KML)
    plan = load_any(path)
    assert [(item.command, item.frame, item.z) for item in plan.items] == [
        (Command.NAV_WAYPOINT, Frame.GLOBAL_RELATIVE_ALT, 12.0), (Command.NAV_WAYPOINT, Frame.GLOBAL_RELATIVE_ALT, 14.0)
    ]  # fmt: skip
    assert [item.position_deg for item in plan.fence] == [(47.4, 8.5), (47.4, 8.51), (47.41, 8.51)]


def test_gpx_track_gives_waypoints_with_the_default_altitude(tmp_path: Path) -> None:
    path = tmp_path / "track.gpx"
    path.write_text(GPX)
    first, second = load_any(path, altitude_m=7.0).items
    assert (first.frame, first.z, second.frame, second.z) == (
        Frame.GLOBAL,
        500.0,
        Frame.GLOBAL_RELATIVE_ALT,
        7.0,
    )


def test_geojson_of_other_programs_gives_waypoints(tmp_path: Path) -> None:
    path = tmp_path / "area.json"
    outline = [[8.5, 47.4], [8.6, 47.4], [8.6, 47.5], [8.5, 47.4]]
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [outline]}))
    assert len(load_any(path).fence) == 3
    path.write_text(json.dumps({"type": "MultiPoint", "coordinates": outline[:2]}))
    assert [item.z for item in load_any(path, altitude_m=9.0).items] == [9.0, 9.0]


def test_a_position_moved_in_another_program_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    save_any(
        path,
        Plan((MissionItem(Command.NAV_WAYPOINT, 6, 3.0, 0.0, 0.0, 0.0, 474000000, 85000000, 5.0),), HOME),
    )
    document = json.loads(path.read_text())
    document["features"][1]["geometry"]["coordinates"] = [8.6, 47.5]
    path.write_text(json.dumps(document))
    (item,) = load_any(path).items
    assert (item.position_deg, item.param1, item.z) == ((47.5, 8.6), 3.0, 5.0)


DAMAGED = {
    "a.kml": ("<kml", "is not valid KML"),
    "b.gpx": ("<gpx><rte>", "is not valid GPX"),
    "bomb.gpx": ('<!DOCTYPE x [<!ENTITY a "b">]><gpx/>', "it has a document type"),
    "c.geojson": ("{", "is not valid JSON"),
    "scenario.toml": (
        'plan = "square"\n[expect]\n',
        "is not a plan file: the formats are .plan, .json, .waypoints, .txt, .mission, .kml, .gpx, .geojson",
    ),
    "empty.csv": ("", "is not a plan file: the formats are"),
    "json.toml": ("{", "is not valid JSON"),
    "d.geojson": ('{"type": "Odd"}', "type: 'Odd' must be one of"),
    "e.geojson": ('{"type": "Point", "coordinates": [8]}', "must be longitude, latitude"),
    "f.geojson": ('{"type": "Point", "coordinates": [8, 95]}', "latitude: 95 must be from -90 to 90"),
    "g.geojson": (
        '{"type": "Feature", "geometry": null, "properties": {"part": "mission", "command": "NO_SUCH"}}',
        "'NO_SUCH' is not a command of MAVLink",
    ),
    "h.geojson": (
        '{"type": "Feature", "geometry": null, "properties": {"part": "mission", "params": [1]}}',
        "params: must be a list of 4 numbers",
    ),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_of_other_formats_raise_one_sentence(tmp_path: Path, name: str) -> None:
    content, problem = DAMAGED[name]
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(ConfigError) as caught:
        load_any(path)
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries, "find_spec", lambda _: None)
    with pytest.raises(CliError, match=r"pip install 'flightstack\[formats\]'"):
        render_kml([])


def test_home_of_a_plan_without_items_survives(tmp_path: Path) -> None:
    home = GeoPoint(47.0, 8.0, 400.0)
    for suffix in (".kml", ".geojson", ".gpx"):
        save_any(tmp_path / f"a{suffix}", Plan((), home))
        assert load_any(tmp_path / f"a{suffix}").home == home


def test_geofence_as_px4_stores_it_is_the_geofence_of_the_file(tmp_path: Path) -> None:
    plan = load_plan("missions/fenced_square.plan")
    stored = tuple(replace(item, autocontinue=False, frame=Frame.GLOBAL_INT) for item in plan.fence)
    assert list(differences(plan.fence, stored)) == []
    assert save_any(tmp_path / "a.plan", replace(plan, fence=stored, document={})) == ""
    assert [difference.field for difference in differences(plan.fence, stored[1:])][-1] == "item"
