"""The geofence against exact rational geometry, and the monitor that watches it in flight."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.guidance.fence import NO_FENCE, Fence, FenceBreach, FenceEvaluator
from flightstack.plan import FenceCommand
from flightstack.plan.fence import fence_shape
from flightstack.plan.fence_areas import Area
from flightstack.plan.fence_shape import FenceShape, edges_that_cross
from tests.support.plan_items import HOME, circle, polygon, square, vertex_items

FRAME = LocalFrame(HOME)
Point = tuple[float, float]
COORDINATES = st.integers(-60, 60)
POINTS = st.tuples(COORDINATES, COORDINATES)


def shape_of(
    polygons: list[list[Point]], inclusion: bool = True, groups: list[int] | None = None
) -> FenceShape:
    """A shape of polygons in metres, put there exactly: without the rounding of latitudes."""
    areas = [
        Area(0, inclusion, (groups or [0] * len(polygons))[index], tuple((0.0, 0.0) for _ in points))
        for index, points in enumerate(polygons)
    ]
    shape = FenceShape(areas, HOME)
    shape.vertices[:] = [point for points in polygons for point in points]
    shape.update_edges()
    return shape


def winding_number(points: list[Point], north: Fraction, east: Fraction) -> int:
    """Exact: how often the polygon goes round a place that is not on its edges."""
    turns = 0
    for (n1, e1), (n2, e2) in zip(points, points[1:] + points[:1], strict=True):
        side = (Fraction(n2) - Fraction(n1)) * (east - Fraction(e1)) - (north - Fraction(n1)) * (
            Fraction(e2) - Fraction(e1)
        )
        if e1 <= east < e2 and side < 0:
            turns -= 1
        elif e2 <= east < e1 and side > 0:
            turns += 1
    return turns


def distance_squared(points: list[Point], north: Fraction, east: Fraction) -> Fraction:
    """Exact: to the nearest edge."""
    best: Fraction | None = None
    for (n1, e1), (n2, e2) in zip(points, points[1:] + points[:1], strict=True):
        dn, de = Fraction(n2) - Fraction(n1), Fraction(e2) - Fraction(e1)
        an, ae = north - Fraction(n1), east - Fraction(e1)
        length2 = dn * dn + de * de
        share = min(max((an * dn + ae * de) / length2, Fraction(0)), Fraction(1)) if length2 else Fraction(0)
        apart = (an - share * dn) ** 2 + (ae - share * de) ** 2
        best = apart if best is None else min(best, apart)
    assert best is not None
    return best


def star_of(seeds: list[tuple[int, int]]) -> list[Point]:
    """A simple polygon of any shape: its vertices at growing angles, more than half a turn apart nowhere."""
    count = len(seeds)
    return [
        (
            radius * math.cos(2 * math.pi * (index + shift / 100.0) / count),
            radius * math.sin(2 * math.pi * (index + shift / 100.0) / count),
        )
        for index, (radius, shift) in enumerate(seeds)
    ]


STARS = st.lists(st.tuples(st.integers(3, 60), st.integers(0, 80)), min_size=3, max_size=12).map(star_of)


@settings(max_examples=300)
@given(points=STARS, place=POINTS)
def test_inside_and_distance_are_those_of_exact_geometry(points: list[Point], place: Point) -> None:
    north, east = Fraction(place[0]), Fraction(place[1])
    apart2 = distance_squared(points, north, east)
    assume(apart2 > Fraction(1, 10**12))
    is_inside = winding_number(points, north, east) != 0
    shape = shape_of([points])
    assert shape.allows(*place) is is_inside
    inside_m, outside_m = Fence(shape).margins(*place)
    assert (inside_m > 0.0) is is_inside
    assert abs(inside_m) == pytest.approx(math.sqrt(apart2), rel=1e-9)
    assert outside_m == math.inf
    inside_m, outside_m = Fence(shape_of([points], inclusion=False)).margins(*place)
    assert (inside_m, outside_m > 0.0) == (math.inf, not is_inside)


@settings(max_examples=200)
@given(points=st.lists(POINTS, min_size=3, max_size=7, unique=True))
def test_polygons_that_cross_themselves_are_found(points: list[tuple[int, int]]) -> None:
    """Against every pair of edges in whole numbers: do they share a point that they should not?"""
    count = len(points)
    edges = [(points[index], points[(index + 1) % count]) for index in range(count)]

    def turn(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> int:
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    def on(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
        return turn(a, b, c) == 0 and all(min(a[i], b[i]) <= c[i] <= max(a[i], b[i]) for i in (0, 1))

    def crosses(one: int, other: int) -> bool:
        (a, b), (c, d) = edges[one], edges[other]
        if other == one + 1:
            return on(a, b, d) or on(c, d, a)
        if one == 0 and other == count - 1:
            return on(a, b, c) or on(c, d, b)
        if any(on(a, b, p) for p in (c, d)) or any(on(c, d, p) for p in (a, b)):
            return True
        return (turn(a, b, c) > 0) != (turn(a, b, d) > 0) and (turn(c, d, a) > 0) != (turn(c, d, b) > 0)

    found = edges_that_cross(np.array(points, dtype=np.float64))
    expected = [pair for pair in itertools.combinations(range(count), 2) if crosses(*pair)]
    assert found == (expected[0] if expected else None)


@settings(max_examples=150)
@given(
    outer=STARS,
    holes=st.lists(st.tuples(POINTS, st.integers(1, 25)), max_size=2),
    begin=POINTS,
    end=POINTS,
)
def test_segments_outside_match_dense_walk(
    outer: list[Point], holes: list[tuple[Point, int]], begin: Point, end: Point
) -> None:
    shape = shape_of([outer])
    areas = [Area(0, False, 0, ((0.0, 0.0),), float(radius)) for _, radius in holes]
    combined = FenceShape([Area(0, True, 0, tuple((0.0, 0.0) for _ in outer)), *areas], HOME)
    combined.vertices[:] = shape.vertices
    combined.update_edges()
    for row, (centre, _) in zip(combined.areas[1:], holes, strict=True):
        row["north"], row["east"] = centre
    walk = np.linspace(begin, end, 400).astype(np.float64)
    fence = Fence(combined)
    clear_m = [min(fence.margins(*place)) for place in walk]
    found = combined.segments_outside(walk[:1], walk[-1:])
    if min(clear_m) < -1e-6:
        assert [index for index, _ in found] == [0]
    elif min(clear_m) > math.dist(begin, end) / 399:  # between two steps nothing can hide
        assert found == []
    for _, place in found:
        assert min(fence.margins(*place)) <= 0.0


def test_groups_of_inclusion_areas() -> None:
    """Inside all areas of at least one group (MAVLink, parameter 2)."""
    west, middle, east = (square(10.0, at=(0.0, offset)) for offset in (-12.0, 0.0, 12.0))
    both = fence_shape(polygon(west) + polygon(middle), HOME)
    assert [both.allows(0.0, e) for e in (-15.0, -6.0, 0.0)] == [False, True, False]
    either = fence_shape(polygon(west, group=3) + polygon(middle, group=7), HOME)
    assert [either.allows(0.0, e) for e in (-25.0, -15.0, -6.0, 0.0, 11.0)] == [
        False,
        True,
        True,
        True,
        False,
    ]
    assert Fence(either).margins(0.0, 0.0)[0] == pytest.approx(10.0, abs=0.02)
    mixed = polygon(west, group=0) + polygon(middle, group=0) + polygon(east, group=1)
    assert [fence_shape(mixed, HOME).allows(0.0, e) for e in (-6.0, 0.0, 15.0)] == [True, False, True]


def test_compiled_and_plan_geometry_agree_on_a_fence_of_everything() -> None:
    items = [
        *polygon(square(100.0)),
        *polygon([(20.0, 20.0), (40.0, 20.0), (40.0, 60.0)], inclusion=False),
        circle((0.0, 0.0), 90.0),
        circle((-30.0, -30.0), 15.0, inclusion=False),
    ]
    fence = Fence.from_items(items, FRAME)
    random = np.random.default_rng(5)
    places = random.uniform(-120.0, 120.0, (3000, 2))
    allowed = fence.shape.allowed(places)
    margins = np.array([min(fence.margins(*place)) for place in places])
    assert ((margins > 0.0) == allowed).all()
    assert 0.2 < allowed.mean() < 0.6


def state(north: float = 0.0, east: float = 0.0, up: float = 0.0, velocity=(0.0, 0.0, 0.0)) -> np.ndarray:
    return np.array([north, east, -up, *velocity, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def monitor(*args: object, **named: object) -> FenceEvaluator:
    watch = FenceEvaluator()
    watch.configure(*args, **named)  # type: ignore[arg-type]
    return watch


def test_each_limit_has_its_flag() -> None:
    fence = Fence.from_items([*polygon(square(50.0)), circle((30.0, 0.0), 5.0, inclusion=False)], FRAME)
    watch = monitor(fence, 45.0, 20.0)
    expected = {
        (0.0, 0.0, 5.0): FenceBreach.NONE,
        (0.0, 52.0, 5.0): FenceBreach.OUTSIDE | FenceBreach.TOO_FAR,
        (30.0, 1.0, 5.0): FenceBreach.EXCLUDED,
        (0.0, 0.0, 21.0): FenceBreach.TOO_HIGH,
        (0.0, 46.0, 25.0): FenceBreach.TOO_FAR | FenceBreach.TOO_HIGH,
    }
    for place, flags in expected.items():
        assert watch.step(state()) == 0
        assert watch.step(state(*place)) == flags == watch.flags
    assert watch.text(15) == (
        "is outside the geofence and inside an exclusion area of the geofence and more than 20 m above home "
        "(GF_MAX_VER_DIST) and more than 45 m from home (GF_MAX_HOR_DIST)"
    )


def test_a_breach_does_not_flicker() -> None:
    watch = monitor(NO_FENCE, 10.0)
    flags = [watch.step(state(north)) for north in (9.9, 10.1, 9.9, 9.2, 10.1, 8.9, 9.9, 10.1)]
    far = FenceBreach.TOO_FAR
    assert flags == [0, far, far, far, far, 0, 0, far]


def test_margin_is_that_of_the_nearest_limit() -> None:
    watch = monitor(Fence.from_items(polygon(square(50.0)), FRAME), 60.0, 20.0)
    watch.step(state(10.0, 0.0, 5.0))
    assert watch.margin_m == pytest.approx(15.0)
    watch.step(state(45.0, 0.0, 5.0))
    assert watch.margin_m == pytest.approx(5.0, abs=0.01)
    watch.step(state(53.0, 0.0, 5.0))
    assert watch.margin_m == pytest.approx(-3.0, abs=0.01)
    assert FenceEvaluator().margin_m == math.inf


def test_prediction_sees_where_braking_ends() -> None:
    now, ahead = monitor(NO_FENCE, 100.0, 50.0), monitor(NO_FENCE, 100.0, 50.0, decelerations_m_s2=(2.0, 4.0))
    fast = state(90.0, 0.0, 10.0, (8.0, 0.0, 0.0))  # stops 16 m ahead
    assert (now.step(fast), ahead.step(fast)) == (0, FenceBreach.TOO_FAR)
    assert ahead.step(state(90.0, 0.0, 10.0, (-8.0, 0.0, 0.0))) == 0
    assert ahead.step(state(0.0, 0.0, 45.0, (0.0, 0.0, -7.0))) == FenceBreach.TOO_HIGH  # 6.1 m more
    assert ahead.step(state(0.0, 0.0, 45.0, (0.0, 0.0, 7.0))) == 0


def test_home_moves_the_limits_but_not_the_areas() -> None:
    fence = Fence.from_items(polygon(square(50.0)), FRAME)
    watch = monitor(fence, 20.0, 10.0, home_ned_m=(40.0, 0.0, -5.0))
    assert watch.step(state(30.0, 0.0, 14.0)) == 0
    assert watch.step(state(0.0, 0.0, 16.0)) == FenceBreach.TOO_FAR | FenceBreach.TOO_HIGH
    assert watch.step(state(52.0, 0.0, 5.0)) & FenceBreach.OUTSIDE


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_state_that_is_not_finite_changes_nothing(bad: float) -> None:
    watch = monitor(Fence.from_items(polygon(square(50.0)), FRAME), 20.0)
    assert watch.step(state(30.0)) == FenceBreach.TOO_FAR
    assert watch.step(state(bad)) == watch.step(state(up=bad)) == FenceBreach.TOO_FAR
    assert watch.refusal(bad, 0.0) == "is nowhere"


def test_refusals_of_places() -> None:
    watch = monitor(Fence.from_items(polygon(square(50.0)), FRAME), 0.0, 30.0, decelerations_m_s2=(1.0, 1.0))
    assert watch.refusal(0.0, 49.0, 30.0) is None
    assert watch.refusal(0.0, 51.0) == "is outside the geofence"
    assert watch.refusal(0.0, 0.0, 31.0) == "is more than 30 m above home (GF_MAX_VER_DIST)"
    assert FenceEvaluator().refusal(1e9, 0.0) is None


def test_no_fence_and_a_removed_fence_break_nothing() -> None:
    watch = FenceEvaluator()
    assert watch.step(state(1e6)) == 0
    watch.configure(Fence.from_items(polygon(square(5.0)), FRAME))
    assert watch.step(state(10.0)) == FenceBreach.OUTSIDE
    watch.configure(Fence.from_items([], FRAME))
    assert (watch.step(state(10.0)), watch.is_active) == (0, False)


def test_a_polygon_across_the_date_line_is_whole() -> None:
    home = GeoPoint(-17.0, 179.9995, 0.0)
    corners = [(-17.001, 179.998), (-17.001, -179.998), (-16.999, -179.998), (-16.999, 179.998)]
    items = vertex_items(FenceCommand.POLYGON_VERTEX_INCLUSION, corners)
    fence = Fence.from_items(items, LocalFrame(home))
    inside_m, _ = fence.margins(0.0, 0.0)
    assert inside_m == pytest.approx(0.001 * 110_600, rel=0.01)
