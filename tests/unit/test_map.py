"""The map: projection, viewport, plan, track and drawing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core.contract import Vector3
from flightstack.mavlink.dialect import mavlink
from flightstack.plan import Command, FenceCommand, Plan
from gcs_cli.charts.canvas import rows_of_text
from gcs_cli.tui.fly.history import History
from gcs_cli.tui.map.drawing import distance_text, draw_map, place_text
from gcs_cli.tui.map.model import MapModel
from gcs_cli.tui.map.scene import (
    TRACK_POINTS,
    Craft,
    MapArea,
    MapPlan,
    MapScene,
    PathItem,
    Place,
    Track,
    map_plan,
)
from gcs_cli.tui.map.viewport import LARGEST_M_PER_DOT, SMALLEST_M_PER_DOT, Viewport, round_step
from gcs_cli.tui.palette import DARK
from gcs_cli.vehicle.view_types import GeoPosition, Identity, Setpoint, Vector
from tests.support.map_views import FRAME, VIEW, item
from tests.support.telemetry_frames import received

pytestmark = pytest.mark.unit

metres = st.floats(-20_000.0, 20_000.0)


def drawn(scene: MapScene, view: Viewport) -> list[str]:
    return rows_of_text(draw_map(scene, view, DARK).rows()).splitlines()


@given(metres, metres, st.floats(0.01, 100.0), st.floats(0.0, 160.0), st.floats(0.0, 96.0))
def test_viewport_converts_dots_to_places_and_back(north, east, scale, x, y):
    view = Viewport(north, east, scale)
    back_x, back_y = view.to_dots(np.array([view.to_place(x, y)]))
    assert back_x[0] == pytest.approx(x, abs=1e-6)  # measured: below 1e-9
    assert back_y[0] == pytest.approx(y, abs=1e-6)


def test_north_is_up_and_east_is_right():
    x, y = Viewport().to_dots(np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]]))
    assert (x[1] - x[0], y[1] - y[0]) == (0.0, -10.0)
    assert (x[2] - x[0], y[2] - y[0]) == (10.0, 0.0)


def test_cursor_place_agrees_with_the_geodesy_of_the_vehicle():
    view = Viewport(width=80, height=24, m_per_dot=0.5)
    place = Place(12.5, -31.25)
    geo = FRAME.to_geo(Vector3(*place, 0.0))
    x, y = view.to_dots(np.array([place]))
    assert view.to_place(x[0], y[0]) == pytest.approx(place)
    text = place_text(FRAME, place, Place(0.0, 0.0))
    assert text.startswith(f"{geo.latitude_deg:.6f}° {geo.longitude_deg:.6f}°")
    assert text.endswith("33.7 m 292° from home")


@given(st.floats(0.1, 10.0), metres, metres)
def test_zoom_keeps_the_place_under_the_cursor(factor, north, east):
    view = Viewport(north, east, 2.0)
    place = view.to_place(10.0, 20.0)
    x, y = view.zoomed(factor, place).to_dots(np.array([place]))
    assert (x[0], y[0]) == pytest.approx((10.0, 20.0), abs=1e-6)


def test_zoom_ends_at_the_limits():
    assert Viewport().zoomed(1e12).m_per_dot == SMALLEST_M_PER_DOT
    assert Viewport().zoomed(1e-12).m_per_dot == LARGEST_M_PER_DOT


@given(st.lists(st.tuples(metres, metres), min_size=1, max_size=9), st.integers(1, 300), st.integers(1, 90))
def test_fitted_view_shows_all_places(places, width, height):
    view = Viewport(width=width, height=height).fitted(np.array(places))
    assert all(view.shows(place) for place in places)


def test_fit_of_nothing_keeps_the_view():
    assert Viewport().fitted(np.zeros((0, 2))) == Viewport()
    assert Viewport().fitted(np.full((3, 2), np.nan)) == Viewport()


def test_pan_moves_the_view_by_dots():
    assert Viewport(m_per_dot=2.0).panned(3, 5)[:2] == (-10.0, 6.0)


@pytest.mark.parametrize(
    ("least", "step"), [(1.0, 1.0), (1.01, 2.0), (3.0, 5.0), (51.0, 100.0), (0.03, 0.05)]
)
def test_scale_steps_are_one_two_five(least, step):
    assert round_step(least) == pytest.approx(step)


@pytest.mark.parametrize(
    ("length_m", "text"), [(0.25, "25 cm"), (5.0, "5 m"), (999.0, "999 m"), (12_500.0, "12.5 km")]
)
def test_distances_have_short_units(length_m, text):
    assert distance_text(length_m) == text


def test_track_is_bounded_and_keeps_the_newest_place():
    track = Track()
    north = np.arange(3 * TRACK_POINTS, dtype=np.float64)
    track.extend(np.column_stack((north, np.zeros_like(north))))
    points = track.points
    assert len(points) <= TRACK_POINTS
    assert points[0].tolist() == [0.0, 0.0]
    assert points[-1, 0] == pytest.approx(north[-1], abs=4.0)
    assert set(np.diff(points[:, 0])) == {4.0}


def test_track_skips_small_steps_and_unknown_places():
    track = Track()
    track.extend(np.array([[0.0, 0.0], [0.05, 0.0], [math.nan, 0.0], [0.2, 0.0]]))
    assert track.points.tolist() == [[0.0, 0.0], [0.2, 0.0]]


def test_plan_shows_places_return_and_jumps():
    home, first, second = Place(0.0, 0.0), Place(30.0, 0.0), Place(30.0, 40.0)
    items = (
        item(Command.NAV_TAKEOFF),
        item(Command.NAV_WAYPOINT, first),
        item(Command.DO_CHANGE_SPEED, param2=3.0),
        item(mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT, second),
        item(Command.DO_JUMP, param1=1.0, param2=2.0),
        item(mavlink.MAV_CMD_DO_SET_ROI_LOCATION, Place(500.0, 500.0)),
        item(Command.NAV_RETURN_TO_LAUNCH),
        item(65_000, first),
    )
    shown = map_plan(Plan(items), FRAME, home)
    assert [(entry.seq, entry.has_mark) for entry in shown.path] == [
        (0, True), (1, True), (3, True), (6, False)
    ]  # fmt: skip
    assert shown.path[0].place == home
    assert shown.path[2].place == pytest.approx(second, abs=0.01)  # measured: 0.003, a step of 1e-7 degrees
    assert shown.jumps == ((shown.path[2].place, shown.path[1].place),)


def test_plan_shows_geofence_and_rally_points():
    corners = [Place(-50.0, -50.0), Place(50.0, -50.0), Place(50.0, 50.0)]
    fence = (
        *(item(FenceCommand.POLYGON_VERTEX_INCLUSION, corner, param1=3.0) for corner in corners),
        item(FenceCommand.CIRCLE_EXCLUSION, Place(10.0, 10.0), param1=5.0),
    )
    shown = map_plan(Plan((), fence=fence, rally=(item(5100, corners[0]),)), FRAME, None)
    polygon, circle = shown.areas
    assert polygon.is_inclusion
    assert np.allclose(polygon.vertices, corners, atol=0.01)
    assert (circle.is_inclusion, circle.radius_m) == (False, 5.0)
    assert shown.rally[0] == pytest.approx(corners[0], abs=0.01)


def test_invalid_geofence_of_a_vehicle_is_named():
    fence = (item(FenceCommand.POLYGON_VERTEX_INCLUSION, Place(0.0, 0.0), param1=3.0),)
    shown = map_plan(Plan((), fence=fence), FRAME, None)
    assert shown.areas == ()
    assert shown.problem.startswith("geofence not drawn: ")


def test_map_draws_vehicle_home_items_and_scale():
    plan = map_plan(Plan((item(16, Place(19.0, 0.5)), item(16, Place(19.0, 30.5)))), FRAME, None)
    scene = MapScene(Craft(Place(0.5, 30.5), 90.0), Place(0.5, 0.5), None, 1, plan)
    rows = drawn(scene, Viewport(10.0, 15.0, 0.5, 60, 16))
    assert rows[0].endswith("N↑")
    assert rows[3] == " " * 15 + "0" + "⠒" * 29 + "1"
    assert rows[12] == " " * 15 + "⌂" + " " * 29 + "→⣀⣀⣀⣀⡀"
    assert rows[-1].startswith(" ├────────┤ 10 m")


def test_map_hatches_exclusion_and_outlines_inclusion():
    square = tuple(Place(n, e) for n, e in ((-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0)))
    count = {}
    for is_inclusion in (True, False):
        scene = MapScene(plan=MapPlan(areas=(MapArea(is_inclusion, square),)))
        count[is_inclusion] = sum(mark >= "⠁" for mark in "".join(drawn(scene, Viewport(width=20, height=8))))
    assert count[True] == 24  # the cells of the outline
    assert count[False] > 40


def test_every_item_number_has_cells_of_its_own():
    places = [Place(0.0, 0.0)] * 4
    plan = map_plan(Plan(tuple(item(16, place) for place in places)), FRAME, None)
    shown = "".join(drawn(MapScene(plan=plan), Viewport(width=30, height=10)))
    assert all(number in shown for number in "0123")


def test_map_of_far_places_draws_only_the_frame():
    scene = MapScene(
        Craft(Place(1e7, 1e7), 0.0),
        Place(-1e9, 0.0),
        plan=MapPlan(areas=(MapArea(True, (Place(0.0, 0.0),), 1e9),)),
    )
    rows = drawn(scene, Viewport(m_per_dot=0.001, width=30, height=6))
    assert "".join(rows[:-1]).split() == ["N↑"]


anywhere = st.floats(-1e9, 1e9)


@given(st.lists(st.tuples(anywhere, anywhere), min_size=1, max_size=5), st.floats(0.0, 360.0))
def test_any_places_are_drawn(places, heading):
    crafts = tuple(Craft(Place(*place), heading) for place in places)
    plan = MapPlan(
        path=tuple(PathItem(seq, Place(*place)) for seq, place in enumerate(places)),
        areas=(MapArea(False, tuple(Place(*place) for place in places)),),
        rally=tuple(Place(*place) for place in places),
    )
    scene = MapScene(crafts[0], crafts[0].place, crafts[0].place, 0, plan, np.array(places), crafts)
    view = Viewport(width=30, height=10).fitted(scene.extent())
    assert len(draw_map(scene, view, DARK, grid=True, cursor=(3, 3)).rows()) == 10


def position(north_m: float, system: int = 1, hdg: int = 65535):
    geo = FRAME.to_geo(Vector3(north_m, 0.0, 0.0))
    message = mavlink.MAVLink_global_position_int_message(
        0, round(geo.latitude_deg * 1e7), round(geo.longitude_deg * 1e7), 0, 0, 0, 0, 0, hdg
    )
    return received(message, system)


def test_model_shows_setpoint_relative_to_the_vehicle():
    scene = MapModel().scene(VIEW, History(), Plan(()))
    assert scene.target == pytest.approx((10.0, -4.0), abs=1e-6)
    assert scene.vehicle == Craft(Place(0.0, 0.0), 45.0)
    assert scene.home == Place(0.0, 0.0)


def test_model_collects_the_track_from_the_history():
    model, history = MapModel(), History()
    for step in range(4):
        history.record(position(5.0 * step), float(step))
        track = model.scene(VIEW, history, Plan(())).track
    assert track[:, 0] == pytest.approx([0.0, 5.0, 10.0, 15.0], abs=0.02)
    model.clear_track()
    assert not len(model.scene(VIEW, history, Plan(())).track)


def test_model_shows_other_vehicles_on_the_link():
    history = History()
    history.record(position(0.0), 1.0)
    history.record(position(20.0, system=3, hdg=9000), 1.0)
    (other,) = MapModel().scene(VIEW, history, Plan(())).others
    assert (other.heading_deg, other.name) == (90.0, "3")
    assert other.place == pytest.approx((20.0, 0.0), abs=0.01)


def test_position_of_zeros_is_unknown():
    model = MapModel()
    unknown = VIEW._replace(geo=GeoPosition(0.0, 0.0, 0.0, 0.0), home=None)
    assert model.scene(unknown, History(), Plan(())) == MapScene()
    assert model.frame is None
    assert model.scene(VIEW, History(), Plan(())).vehicle is not None


def test_switching_the_vehicle_drops_the_track():
    model, history = MapModel(), History()
    history.record(position(0.0), 1.0)
    assert len(model.scene(VIEW, history, Plan(())).track) == 1
    other = VIEW._replace(identity=Identity(2, 1, 2, 12))
    assert not len(model.scene(other, history, Plan(())).track)


def test_setpoint_beyond_the_earth_is_not_shown():
    far = VIEW._replace(setpoint=Setpoint(Vector(3e38, 0.0, 0.0)))
    assert MapModel().scene(far, History(), Plan(())).target is None
