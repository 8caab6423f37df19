"""The braille canvas: dots, clipping, dashes, areas, text and rows of segments."""

import numpy as np
import pytest

from gcs_cli.charts.canvas import DASHED, Canvas, circle_vertices, rows_of_text

pytestmark = pytest.mark.unit


def shown(canvas):
    return rows_of_text(canvas.rows())


@pytest.mark.parametrize(
    ("dot", "mark"),
    [((0, 0), "⠁"), ((0, 3), "⡀"), ((1, 0), "⠈"), ((1, 2), "⠠"), ((1, 3), "⢀")],
)
def test_each_dot_sets_its_own_bit(dot, mark):
    canvas = Canvas(1, 1)
    canvas.points([dot[0]], [dot[1]])
    assert shown(canvas) == mark


def test_diagonal_of_a_square_is_drawn_without_gaps():
    canvas = Canvas(4, 2)
    canvas.line([0.5, 7.5], [0.5, 7.5])
    assert shown(canvas) == "⠑⢄\n  ⠑⢄"


def test_segment_through_the_canvas_is_clipped_to_it():
    canvas, whole = Canvas(10, 3), Canvas(10, 3)
    canvas.line([-1e9, 1e9], [5.5, 5.5])
    whole.line([0, 19.9], [5.5, 5.5])
    assert shown(canvas) == shown(whole)
    assert shown(canvas).splitlines()[1] == "⠒" * 10


def test_lines_beside_the_canvas_and_nan_draw_nothing():
    canvas = Canvas(5, 5)
    canvas.line([-5, -1, np.nan, 3, 40], [-5, 30, 3, np.nan, 40])
    canvas.line([2.0], [2.0])
    canvas.line([], [])
    canvas.points([-1, 10, 3], [3, 3, -0.5])
    assert not shown(canvas).strip()


def test_nan_separates_two_lines():
    canvas = Canvas(4, 1)
    canvas.line([0, 1, np.nan, 6, 7], [0, 0, np.nan, 0, 0])
    assert shown(canvas) == "⠉  ⠉"


def test_dashes_have_dots_and_gaps_of_equal_length():
    canvas = Canvas(8, 1)
    canvas.line([0.5, 8.5, 15.5], [0.5, 0.5, 0.5], dash=DASHED)
    assert shown(canvas) == "⠉⠉  ⠉⠉"


def test_circle_differs_from_a_true_one_by_less_than_a_dot():
    for radius in (3.0, 40.0, 2_000.0):
        x, y = circle_vertices(0.0, 0.0, radius)
        middles = np.hypot(x + np.roll(x, -1), y + np.roll(y, -1)) / 2
        assert np.max(radius - middles) < 0.5  # measured: 0.10, 0.30, 0.30


def test_hatch_stays_inside_a_polygon_with_a_notch():
    canvas = Canvas(10, 5)
    canvas.hatch([0, 20, 20, 10, 0], [0, 0, 20, 5, 20], spacing=1)
    rows = shown(canvas).splitlines()
    assert rows[0] == "⣿" * 10
    assert rows[4] == "⠟        ⠻"


def test_hatch_of_a_huge_polygon_covers_the_canvas():
    canvas = Canvas(6, 2)
    canvas.hatch([-1e8, 1e8, 1e8, -1e8], [-1e8, -1e8, 1e8, 1e8], spacing=1)
    assert shown(canvas) == "⣿" * 6 + "\n" + "⣿" * 6


def test_text_is_clipped_and_stays_above_later_lines():
    canvas = Canvas(5, 1)
    canvas.label(-2, 0, "abcd", "bold")
    canvas.label(4, 0, "xy")
    canvas.label(0, 3, "below")
    canvas.line([0, 9], [0, 0])
    assert shown(canvas) == "cd⠉⠉x"


def test_control_and_wide_characters_keep_the_columns():
    canvas = Canvas(6, 1)
    canvas.label(0, 0, "a\x1b\n漢b")
    assert shown(canvas) == "a···b"


def test_labels_near_each_other_do_not_merge():
    canvas = Canvas(6, 3)
    for number in ("1", "18", "2", "3", "4"):
        canvas.label_near(1, 1, number)
    assert shown(canvas) == " 2 4\n 1 18\n 3"


def test_a_label_without_room_is_left_out():
    canvas = Canvas(3, 1)
    canvas.label_near(1, 0, "1")
    canvas.label_near(1, 0, "2")
    for outside in ((-1, 0), (-2, 0), (3, 0), (4, 0), (1, -1), (1, 1)):
        canvas.label_near(*outside, "3")
    assert shown(canvas) == " 1"


def test_rows_fill_the_width_and_colours_make_runs():
    canvas = Canvas(6, 2)
    canvas.points([0, 2], [0, 0], "red")
    canvas.points([4], [0], "green")
    first, second = canvas.rows()
    assert [(text, str(style)) for text, style in first] == [
        ("⠁⠁", "red"),
        ("⠁   ", "green"),
    ]
    assert [text for text, _ in second] == [" " * 6]
    assert canvas.text().plain == "⠁⠁⠁   \n      "


def test_blank_cells_continue_only_styles_that_do_not_show_on_them():
    canvas = Canvas(6, 1)
    canvas.label(1, 0, "a", "bold red")
    canvas.label(3, 0, "b", "red on blue")
    (row,) = canvas.rows()
    assert [(text, str(style)) for text, style in row] == [
        (" ", "none"),
        ("a ", "bold red"),
        ("b", "red on blue"),
        ("  ", "none"),
    ]


@pytest.mark.parametrize("size", [(0, 0), (0, 4), (4, 0), (-3, 2)])
def test_empty_canvas_accepts_all_drawing(size):
    canvas = Canvas(*size)
    canvas.circle(0, 0, 5)
    canvas.hatch([0, 1, 1], [0, 0, 1])
    canvas.label(0, 0, "x")
    assert not canvas.text().plain.strip()
