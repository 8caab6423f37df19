"""CPU load, line coverage and stack of a target's code: figures, and their place in the report."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flightstack.firmware.toolchain.coverage import FileCoverage, file_names, line_coverage, merged
from flightstack.firmware.toolchain.stack_usage import deepest, read_graphs
from gcs_cli.pil.code_facts import coverage_json
from gcs_cli.pil.pil_commands import code_lines
from gcs_cli.pil.profile import EMULATED_CLOCK_HZ, cpu_load, stage_profiles
from gcs_cli.pil.report import render_report
from gcs_cli.pil.result import assembled, profiles_of
from tests.support.parsed_page import parsed
from tests.support.pil_records import FACTS, record

COSTS = np.array([[300.0, 500.0, 400.0, 1200.0], [0.0, 500.0, 400.0, 1000.0]])


def test_cpu_load_is_the_cost_of_a_step_over_its_period() -> None:
    load = cpu_load(stage_profiles(COSTS), "cycles", 200e6, 500.0)
    assert load is not None
    assert load.largest == pytest.approx(100.0 * 1200.0 / (200e6 * 0.002))  # 0.3 %
    assert load.mean == pytest.approx(100.0 * 1100.0 / (200e6 * 0.002))
    assert load.as_json()["period_us"] == 2000.0


def test_cpu_load_of_an_emulated_target_names_its_clock() -> None:
    load = cpu_load(stage_profiles(COSTS), "instructions", 0.0, 1000.0)
    assert load is not None
    assert load.clock_hz == EMULATED_CLOCK_HZ
    assert "one cycle each at 168 MHz" in load.about
    assert "lower bound" in load.about


def test_cpu_load_is_unknown_without_clock_cost_or_period() -> None:
    assert cpu_load(stage_profiles(COSTS), "cycles", 0.0, 500.0) is None
    assert cpu_load(stage_profiles(COSTS), "cycles", 200e6, None) is None
    assert cpu_load(stage_profiles(0.0 * COSTS), "cycles", 200e6, 500.0) is None


def test_blocks_that_touch_are_one_range() -> None:
    starts, sizes = np.array([32, 0, 16, 100]), np.array([8, 16, 4, 2])
    assert merged(starts, sizes) == [(0, 20), (32, 40), (100, 102)]


def test_coverage_of_a_missing_image_is_unknown(tmp_path: Path) -> None:
    assert line_coverage(tmp_path / "none.elf", []) is None


@pytest.mark.parametrize(
    ("version", "folder", "name", "place"),
    [(4, "/a/core", "fs_b.c", 1), (4, "/a", "x/core/fs_b.c", 1), (5, "/a", "core/fs_b.c", 0)],
)
def test_files_are_named_by_folder_however_their_path_is_split(
    version: int, folder: str, name: str, place: int
) -> None:
    """A compiler that runs above its sources writes their folders into the name of the file."""
    entry = SimpleNamespace(dir_index=place, name=name.encode())
    header = {"version": version, "include_directory": [folder.encode()], "file_entry": [entry]}
    assert list(file_names(header)) == ["core/fs_b.c"]


def test_an_image_without_lines_of_the_loops_has_no_line_of_coverage() -> None:
    assert list(code_lines({"load": None, "coverage": coverage_json({}), "stack_usage": None})) == []


def test_total_coverage_is_that_of_the_loops() -> None:
    files = {"core/a.c": FileCoverage(8, 6, (3, 4)), "app/b.c": FileCoverage(10, 0, tuple(range(10)))}
    found = coverage_json(files)
    assert (found["lines"], found["executed"], found["percent"]) == (8, 6, 75.0)
    assert found["files"]["core/a.c"]["missed"] == [3, 4]
    assert coverage_json({})["percent"] is None


GRAPH = """graph: { title: "a.c"
node: { title: "step" label: "step\\na.c:9:6\\n64 bytes (static)\\n0 dynamic objects" }
node: { title: "a.c:helper" label: "helper\\na.c:3:13\\n24 bytes (static)\\n0 dynamic objects" }
node: { title: "sqrtf" label: "sqrtf\\n<built-in>" shape : ellipse }
edge: { sourcename: "step" targetname: "a.c:helper" label: "a.c:11:5" }
edge: { sourcename: "step" targetname: "other" label: "a.c:12:5" }
edge: { sourcename: "a.c:helper" targetname: "sqrtf" label: "a.c:4:5" }
}
"""
OTHER = """graph: { title: "b.c"
node: { title: "other" label: "other\\nb.c:3:6\\n100 bytes (static)\\n0 dynamic objects" }
}
"""


def test_deepest_path_has_the_largest_sum_of_frames() -> None:
    graph = read_graphs([GRAPH, OTHER])
    assert graph.frames == {"step": 64, "a.c:helper": 24, "other": 100}
    assert deepest(graph) == (("step", "other"), 164, True)


def test_stack_has_no_bound_with_a_cycle_a_pointer_or_a_variable_frame() -> None:
    cycle = OTHER.replace("}\n}", '}\nedge: { sourcename: "other" targetname: "step" label: "" }\n}')
    assert deepest(read_graphs([GRAPH, cycle]))[2] is False
    pointer = OTHER.replace(
        "}\n}", '}\nedge: { sourcename: "other" targetname: "__indirect_call" label: "" }\n}'
    )
    assert deepest(read_graphs([GRAPH, pointer]))[1:] == (164, False)
    dynamic = OTHER.replace("(static)", "(dynamic)")
    assert deepest(read_graphs([GRAPH, dynamic]))[1:] == (164, False)


def test_report_shows_load_coverage_and_stack() -> None:
    of_target = record()
    usage = {
        "compiler": "gcc 12",
        "frames": {"step": 64},
        "path": ["step", "other"],
        "total": 164,
        "is_bounded": True,
    }
    coverage = coverage_json({"core/a.c": FileCoverage(8, 6, (3, 4))})
    facts = {**FACTS, "inner_hz": 500.0, "coverage": coverage, "stack_usage": usage}
    result = {**assembled([], [], of_target, facts), "tiles": []}
    text = parsed(render_report(result, [], profiles_of(of_target), of_target.costs)).text
    assert "core/a.c" in text
    assert "3, 4" in text
    assert "step → other, 164 bytes" in text
    assert "2000 µs at 168 MHz" in text
    assert "Cost of a step over time" in text
