"""The scene: attitude and position of the vehicle in the model and in the pixels of a picture."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

from flightstack.core.geometry_bulk import quaternions_from_euler
from flightstack.flight_log.poses_file import Poses
from flightstack.params.vehicle import built_in_vehicles, load_vehicle
from sim_bridge.errors import UsageProblemError
from sim_bridge.multibody.frames import flip_vector
from sim_bridge.multibody.mjcf import model_xml
from sim_bridge.render import offscreen
from sim_bridge.render.cameras import CAMERAS, Site, View, project, view
from sim_bridge.render.overlay import Label, Overlay, scale_bar
from sim_bridge.render.pictures import announcement, film_of
from sim_bridge.render.poses import FlightPath, Moment
from sim_bridge.render.renderer import Picture, Renderer, Stage
from tests.support.sample_poses import sample_poses
from tests.support.tools import missing

WIDTH, HEIGHT = 480, 270


@cache
def stage(vehicle: str) -> Stage:
    return Stage(load_vehicle(vehicle))


def standing(
    roll_deg: float = 0.0,
    pitch_deg: float = 0.0,
    yaw_deg: float = 0.0,
    speed: float = 0.0,
    height: float = 2.0,
) -> FlightPath:
    euler = np.radians([[roll_deg, pitch_deg, yaw_deg]])
    return FlightPath(
        Poses(
            np.zeros(1), np.array([[0.0, 0.0, -height]]), quaternions_from_euler(euler), np.full((1, 4), speed),
            np.full((1, 3), np.nan),
        )
    )  # fmt: skip


def rotors(path: FlightPath, vehicle: str = "paper_quad") -> np.ndarray:
    """Rotor positions NWU [m]: front, right, back, left for the plus frame."""
    place = stage(vehicle)
    place.put(path.at(0.0))
    return np.array([place.data.body(f"rotor_{number}").xpos for number in range(1, 5)])


def test_nose_points_north_and_right_side_east() -> None:
    front, right, back, left = rotors(standing())
    assert front == pytest.approx((0.2, 0.0, 2.0), abs=1e-9)
    assert right == pytest.approx((0.0, -0.2, 2.0), abs=1e-9)
    assert back[0] < 0.0 < left[1]


def test_roll_right_lowers_the_right_side() -> None:
    _, right, _, left = rotors(standing(roll_deg=30.0))
    assert right[2] - left[2] == pytest.approx(-0.4 * math.sin(math.radians(30.0)))


def test_pitch_up_raises_the_nose_and_yaw_right_turns_it_east() -> None:
    front, _, back, _ = rotors(standing(pitch_deg=20.0))
    assert front[2] - back[2] == pytest.approx(0.4 * math.sin(math.radians(20.0)))
    front = rotors(standing(yaw_deg=90.0))[0]
    assert front == pytest.approx((0.0, -0.2, 2.0), abs=1e-9)


def test_rotors_turn_in_their_sense_of_rotation() -> None:
    """Seen from above, rotor 1 of the paper's vehicle turns clockwise, rotor 2 counter-clockwise."""
    place = stage("paper_quad")
    turns = []
    for angle in (0.0, 0.1):
        place.put(standing().at(0.0)._replace(rotor_angle_rad=(angle,) * 4))
        turns.append([place.data.body(f"rotor_{number}").xmat.reshape(3, 3)[1, 0] for number in (1, 2)])
    first, second = np.array(turns[1]) - np.array(turns[0])
    assert first == pytest.approx(-math.sin(0.1))
    assert second == pytest.approx(math.sin(0.1))


@pytest.mark.parametrize("vehicle", built_in_vehicles())
def test_a_standing_vehicle_stands_on_the_pad(vehicle: str) -> None:
    """Its lowest part is within 1 cm of the top of the pad, and no part of the scene is near."""
    place = stage(vehicle)
    place.put(standing(height=0.0).at(0.0))
    model, data = place.model, place.data
    pad = model.geom("pad").id
    top = data.geom_xpos[pad][2] + model.geom_size[pad][2]
    feet = [g for g in range(model.ngeom) if (model.geom(g).name or "").startswith("foot")]
    lowest = min(data.geom_xpos[foot][2] - model.geom_size[foot][0] for foot in feet)
    assert lowest == pytest.approx(top, abs=0.01)
    for name in CAMERAS:
        assert model.camera(name).id >= 0
    assert not model.geom_contype[[g for g in place.shadeless if model.geom(g).name != "ground"]].any()


def test_rotor_discs_appear_and_redden_with_speed() -> None:
    place = stage("paper_quad")
    place.rotors.show((0.0, 150.0, 300.0, math.nan))
    disc = [place.model.geom(f"disc_{n}").rgba for n in range(1, 5)]
    blade = [place.model.geom(f"blade_{n}_0").rgba for n in range(1, 5)]
    assert disc[0][3] == disc[3][3] == 0.0 < disc[1][3]
    assert blade[0][3] == blade[3][3] == 1.0 > blade[1][3]
    assert disc[2][0] - disc[2][2] > disc[1][0] - disc[1][2]


# ------------------------------------------------------------------ pixels


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    try:
        made = Renderer(load_vehicle("x_quad"), standing(), WIDTH, HEIGHT)
    except UsageProblemError as error:
        missing(str(error))
    with made:
        yield made


def orange(picture: Picture) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of pixels in the colour of the front arms."""
    red, green, blue = (picture[:, :, channel].astype(int) for channel in range(3))
    return np.nonzero((red > 80) & (red > 1.6 * green) & (red > 2 * blue))


def seen(renderer: Renderer, moment: Moment, camera: str = "chase") -> Picture:
    return renderer.draw(moment, camera)


def over_grass(path: FlightPath) -> Moment:
    """A moment far from other orange objects."""
    return path.at(0.0)._replace(position_ned_m=(15.0, 12.0, -3.0))


def arm_heights(picture: Picture) -> tuple[float, float]:
    """Heights of the left and the right front arm in the picture [pixels above the middle]."""
    rows, columns = orange(picture)
    assert len(rows) > 20
    middle = np.median(columns)
    return (
        HEIGHT / 2 - float(rows[columns < middle].mean()),
        HEIGHT / 2 - float(rows[columns > middle].mean()),
    )


def test_picture_shows_a_roll_to_the_right(renderer: Renderer) -> None:
    difference = {}
    for roll in (-25.0, 0.0, 25.0):
        left, right = arm_heights(seen(renderer, over_grass(standing(roll_deg=roll))))
        difference[roll] = left - right
    assert difference[25.0] > difference[0.0] + 5.0  # measured: −16, −4 and 7 pixels
    assert difference[-25.0] < difference[0.0] - 5.0


def test_top_view_has_north_up_and_shows_the_heading(renderer: Renderer) -> None:
    for yaw, row_sign, column_sign in ((0.0, -1, 0), (90.0, 0, 1), (180.0, 1, 0), (-90.0, 0, -1)):
        rows, columns = orange(seen(renderer, over_grass(standing(yaw_deg=yaw)), "top"))
        down, right = rows.mean() - HEIGHT / 2, columns.mean() - WIDTH / 2
        if row_sign:
            assert np.sign(down) == row_sign
            assert abs(down) > 2.0 * abs(right)
        else:
            assert np.sign(right) == column_sign
            assert abs(right) > 2.0 * abs(down)


@pytest.mark.parametrize("camera", CAMERAS)
def test_every_camera_shows_the_scene(renderer: Renderer, camera: str) -> None:
    """Many colours, and grass or concrete."""
    picture = seen(renderer, FlightPath(sample_poses(4.0)).at(2.0), camera)
    assert picture.shape == (HEIGHT, WIDTH, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500
    red, green, blue = (picture[:, :, channel].astype(int) for channel in range(3))
    assert ((green > red) & (green > blue)).mean() > 0.05 or (abs(red - green) < 12).mean() > 0.2


def test_the_same_moment_gives_the_same_picture(renderer: Renderer) -> None:
    path = FlightPath(sample_poses(4.0))
    first = seen(renderer, path.at(1.5))
    seen(renderer, path.at(3.0), "side")
    np.testing.assert_array_equal(seen(renderer, path.at(1.5)), first)


def test_figures_need_a_minimum_picture_size(renderer: Renderer) -> None:
    moment = FlightPath(sample_poses(4.0)).at(2.0)
    picture = seen(renderer, moment)
    with_words = np.asarray(Overlay("a title", (300.0,) * 4, WIDTH, HEIGHT).write(picture, moment))
    assert (with_words != picture).any()
    small = picture[:64, :64].copy()
    np.testing.assert_array_equal(np.asarray(Overlay("", (300.0,) * 4, 64, 64).write(small, moment)), small)


def test_small_pictures_have_waypoint_labels_but_no_figures(renderer: Renderer) -> None:
    moment = standing().at(0.0)
    picture, seen_from = seen(renderer, moment, "side"), renderer.view(moment, "side")
    places = [Label("7", (0.5, 0.0, 2.3)), Label("8", (9.0, 60.0, 2.3))]
    written = np.asarray(Overlay("", (), 300, HEIGHT, places).write(picture, moment, seen_from))
    rows, columns = np.nonzero((written != picture).any(axis=2))
    x, y = project(seen_from, places[0].at_m, (WIDTH, HEIGHT)) or (0.0, 0.0)
    assert 0 < len(rows) < 600
    assert abs(columns.mean() - x) < 2.0
    assert y - 30.0 < rows.mean() < y


def test_projection_agrees_with_the_renderer(renderer: Renderer) -> None:
    """The pixels of the target sphere are at its projected position."""
    for camera in CAMERAS:
        place = (0.3, 0.2, -2.2) if camera != "whole" else (0.0, 0.0, -2.0)
        moment = standing().at(0.0)._replace(target_ned_m=place)
        picture = renderer.draw(moment, camera).astype(int)
        pink = (picture[:, :, 0] > 150) & (picture[:, :, 1] < 0.55 * picture[:, :, 0]) & (
            picture[:, :, 2] > 1.3 * picture[:, :, 1]
        )  # fmt: skip
        rows, columns = np.nonzero(pink)
        assert len(rows) > 3, camera
        x, y = project(renderer.view(moment, camera), flip_vector(place), (WIDTH, HEIGHT)) or (0.0, 0.0)
        assert np.hypot(columns - x, rows - y).min() < 5.0, camera


def test_points_behind_the_camera_are_not_projected() -> None:
    seen = View((0.0, 0.0, 2.0), 3.0, 0.0, 0.0)
    assert project(seen, (0.0, 0.0, 2.0), (WIDTH, HEIGHT)) == pytest.approx((WIDTH / 2, HEIGHT / 2))
    assert project(seen, (-3.0, 0.0, 2.0), (WIDTH, HEIGHT)) is None
    east = project(seen, (0.0, -1.0, 2.0), (WIDTH, HEIGHT))
    assert east is not None
    assert east[0] - WIDTH / 2 == pytest.approx(1.0 / seen.pixel_m(HEIGHT))


def test_whole_view_contains_the_whole_path() -> None:
    site = Site(0.5, 0.0, (-3.0, -20.0, 0.0), (7.0, 5.0, 6.0), WIDTH / HEIGHT)
    seen = view("whole", standing().at(0.0), site)
    for x in (-3.0, 7.0):
        for y in (-20.0, 5.0):
            for z in (0.0, 6.0):
                at = project(seen, (x, y, z), (WIDTH, HEIGHT))
                assert at is not None
                assert 0.0 < at[0] < WIDTH
                assert 0.0 < at[1] < HEIGHT


def test_scale_bar_is_1_m_if_possible() -> None:
    near, far = View((0.0, 0.0, 0.0), 5.0, 0.0, -90.0), View((0.0, 0.0, 0.0), 500.0, 0.0, -90.0)
    assert scale_bar(near, (WIDTH, HEIGHT)) == pytest.approx(
        (1.0, HEIGHT / (10.0 * math.tan(math.radians(22.5))))
    )
    length_m, pixels = scale_bar(far, (WIDTH, HEIGHT))
    assert length_m == 50.0
    assert pixels == pytest.approx(50.0 * HEIGHT / (1000.0 * math.tan(math.radians(22.5))))


def test_discs_of_the_window_cast_no_shadow() -> None:
    place = stage("x_quad")
    place.put(standing(speed=200.0).at(0.0))
    scene = mujoco.MjvScene(place.model, maxgeom=100)
    place.rotors.replace_discs(scene, place.data)
    drawn = scene.geoms[: scene.ngeom]
    assert len(drawn) == 4
    for geom, disc in zip(drawn, sorted(place.rotors.discs), strict=True):
        assert geom.category == mujoco.mjtCatBit.mjCAT_DECOR
        np.testing.assert_allclose(geom.pos, place.data.geom_xpos[disc], atol=1e-6)
        radius, half_height, _ = place.model.geom_size[disc]
        assert geom.size == pytest.approx((radius, radius, half_height))
        assert geom.rgba[3] > 0.0 == place.model.geom_rgba[disc][3]
    place.put(standing(speed=0.0).at(0.0))
    scene.ngeom = 0
    place.rotors.replace_discs(scene, place.data)
    assert scene.ngeom == 0


def test_trail_follows_the_path_with_few_points() -> None:
    path = FlightPath(sample_poses(20.0))
    flown, drawn = path.poses.position_ned_m, path.trail(20.0, 10_000)
    assert len(drawn) < len(flown) / 4
    begin, chord = drawn[:-1], np.diff(drawn, axis=0)
    square = np.maximum((chord**2).sum(axis=1), 1e-12)
    for point in flown[::7]:
        share = np.clip(((point - begin) * chord).sum(axis=1) / square, 0.0, 1.0)
        assert np.linalg.norm(begin + share[:, None] * chord - point, axis=1).min() < 0.015


def test_long_film_is_announced() -> None:
    film = film_of(Path("a/f.mp4"), 0.0, 25.0, 30.0, 1.0)
    assert announcement(film, 44.0) == ""
    assert announcement(film, 170.0) == (
        "f.mp4: 750 frames, about 3 min; --from, --to, --size and --fps reduce the time"
    )


# ------------------------------------------------------------------ no renderer


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("disable", "no off-screen renderer: MUJOCO_GL=disable turns it off; unset it"),
        ("nonsense", "MUJOCO_GL=nonsense is not a renderer; set it to egl or osmesa, or unset it"),
    ],
)
def test_mujoco_gl_selects_the_renderer(monkeypatch: pytest.MonkeyPatch, value: str, said: str) -> None:
    monkeypatch.setenv("MUJOCO_GL", value)
    with pytest.raises(UsageProblemError) as caught:
        offscreen.choose_backend()
    assert str(caught.value) == said


def test_error_without_a_renderer_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    monkeypatch.setattr(offscreen.ctypes.util, "find_library", lambda _name: None)
    with pytest.raises(UsageProblemError) as caught:
        offscreen.choose_backend()
    assert str(caught.value) == offscreen.NO_RENDERER


def test_failing_renderer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(offscreen, "choose_backend", lambda: "sim_bridge.errors")  # has no GLContext
    with pytest.raises(UsageProblemError, match="no off-screen renderer: install EGL"):
        offscreen.make_context(10, 10)


def test_plain_mujoco_reads_the_scene(tmp_path: Path) -> None:
    file = tmp_path / "scene.xml"
    file.write_text(model_xml(load_vehicle("paper_quad"), scene=True))
    assert mujoco.MjModel.from_xml_path(str(file)).ngeom > 100
