"""Files of parameters and of their metadata."""

from __future__ import annotations

import io
import json
import lzma
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from flightstack.core.errors import ConfigError
from flightstack.mavlink.param_values import Parameter
from flightstack.params.param_file import ParamLine, format_params
from gcs_cli.vehicle.param_info import (
    ParamInfo,
    load_parameters,
    number_text,
    parse_metadata,
    render_parameters,
)
from gcs_cli.vehicle.param_table import matching, parameter_table
from tests.support.param_vehicle import METADATA

# ---------------------------------------------------------------------- table, files and metadata


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("*", ["AB_C", "AB_D", "XAB"]),
        ("ab", ["AB_C", "AB_D", "XAB"]),
        ("AB*", ["AB_C", "AB_D"]),
        ("ab_?", ["AB_C", "AB_D"]),
        ("AB_[C]", ["AB_C"]),
        ("q", []),
    ],
)
def test_patterns(pattern: str, names: list[str]) -> None:
    parameters = [Parameter(name, 0.0, False, 0, 3) for name in ("AB_C", "AB_D", "XAB")]
    assert [told.name for told in matching(parameters, pattern)] == names


def test_the_table_fits_a_terminal_of_80_columns() -> None:
    infos = parse_metadata(lzma.compress(json.dumps({"parameters": METADATA}).encode()))
    parameters = [
        Parameter("MPC_XY_CRUISE", 7.123456, False, 0, 3),
        Parameter("ABCDEFGHIJKLMNOP", 0.38729835, False, 1, 3),
    ]
    infos["ABCDEFGHIJKLMNOP"] = ParamInfo(1.0, -1e38, 1e38, "rad/s^2", "A long line of help " * 4)
    console = Console(width=80, file=io.StringIO(), force_terminal=False)
    console.print(parameter_table(parameters, infos))
    output = console.file
    assert isinstance(output, io.StringIO)
    lines = output.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    assert "ABCDEFGHIJKLMNOP" in output.getvalue()
    assert "0.38729835" in output.getvalue()


@given(
    st.dictionaries(
        st.text("ABC_", min_size=1, max_size=16),
        st.tuples(st.floats(width=32, allow_nan=False, allow_infinity=False), st.just(False))
        | st.tuples(st.integers(-(2**31), 2**31 - 1).map(float), st.just(True)),
        max_size=9,
    )
)
def test_a_file_brings_every_value_back(
    tmp_path_factory: pytest.TempPathFactory, values: dict[str, tuple[float, bool]]
) -> None:
    path = tmp_path_factory.mktemp("params") / "all.params"
    parameters = [Parameter(name, value, kind, 0, 1) for name, (value, kind) in values.items()]
    path.write_text(render_parameters(parameters, 1, 1), encoding="utf-8")
    loaded = load_parameters(path)
    assert {name: number_text(value) for name, value in loaded.items()} == {
        told.name: number_text(told.value) for told in parameters
    }


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("1\t1\tNAME", "line 1: has 3 columns between tabs, expected 5"),
        ("1 1 NAME 1 9", "line 1: has 1 columns between tabs"),
        ("# fine\n\n1\t1\tNAME\tx\t9", "line 3: NAME: 'x' is not a number"),
        ("1\t1\tNAME\tnan\t9", "line 1: NAME: 'nan' is not a number"),
        (
            "1\t1\tNAME_OF_TOO_MANY_LETTERS\t1\t9",
            "line 1: 'NAME_OF_TOO_MANY_LETTERS' is not a parameter name",
        ),
        ("1\t1\tA\t1\t9\n1\t1\tA\t2\t9", "line 2: A is already set in line 1"),
    ],
)
def test_a_bad_line_is_named(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "bad.params"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=problem):
        load_parameters(path)


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "bad.params"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="is not a text file"):
        load_parameters(path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        load_parameters(tmp_path / "none.params")


def test_a_file_of_the_flight_stack_is_read_too(tmp_path: Path) -> None:
    path = tmp_path / "params-0.params"
    path.write_text(format_params([ParamLine("MPC_XY_CRUISE", 3.5, False), ParamLine("GF_ACTION", 2, True)]))
    assert load_parameters(path) == {"MPC_XY_CRUISE": 3.5, "GF_ACTION": 2.0}


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
KEYS = st.sampled_from(
    [
        "name",
        "default",
        "min",
        "max",
        "units",
        "shortDesc",
        "values",
        "rebootRequired",
        "value",
        "description",
    ]
)


@settings(max_examples=200)
@given(st.lists(st.dictionaries(KEYS, JSON | st.just("P"), max_size=8) | JSON, max_size=4))
def test_any_metadata_is_read_or_passed_over(entries: list[object]) -> None:
    infos = parse_metadata(lzma.compress(json.dumps({"parameters": entries}).encode()))
    for name, info in infos.items():
        assert isinstance(name, str)
        assert info.help.isprintable()


@given(st.binary(max_size=40) | st.binary(max_size=40).map(lzma.compress))
def test_bytes_that_are_no_metadata_are_none(data: bytes) -> None:
    assert parse_metadata(data) == {}


def test_a_small_file_that_grows_without_end_is_cut() -> None:
    assert parse_metadata(lzma.compress(b" " * 40_000_000 + b'{"parameters": [{"name": "A"}]}')) == {}
