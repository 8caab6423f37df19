"""Search over names and descriptions of parameters."""

from __future__ import annotations

import pytest

from flightstack.mavlink.param_values import Parameter
from gcs_cli.vehicle.param_info import ParamInfo
from gcs_cli.vehicle.param_search import near_names, search_parameters
from gcs_cli.vehicle.param_table import description

INFOS = {
    "MPC_XY_CRUISE": ParamInfo(help="Horizontal speed in auto modes"),
    "MPC_XY_VEL_MAX": ParamInfo(help="Maximum horizontal speed"),
    "GF_ACTION": ParamInfo(help="Geofence breach action", choices=((2.0, "Hold"),)),
    "GF_MAX_HOR_DIST": ParamInfo(
        help="Maximum distance", details="Horizontal limit of the geofence, from home"
    ),
    "NAV_ACC_RAD": ParamInfo(help="Acceptance radius of waypoints"),
}
PARAMETERS = [Parameter(name, 0.0, False, index, 5) for index, name in enumerate(INFOS)]


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["geofence"], ["GF_ACTION", "GF_MAX_HOR_DIST"]),
        (["gf"], ["GF_ACTION", "GF_MAX_HOR_DIST"]),
        (["horizontal", "speed"], ["MPC_XY_CRUISE", "MPC_XY_VEL_MAX"]),
        (["acceptence"], ["NAV_ACC_RAD"]),  # misspelt
        (["hold"], ["GF_ACTION"]),  # a choice
        (["mpcvel"], ["MPC_XY_VEL_MAX"]),  # letters of the name
        (["geofence max"], ["GF_MAX_HOR_DIST"]),
        (["battery"], []),
    ],
)
def test_search_finds_by_name_and_description(words: list[str], names: list[str]) -> None:
    assert [each.name for each in search_parameters(PARAMETERS, INFOS, words)] == names


def test_search_prefers_names_to_descriptions() -> None:
    found = search_parameters(PARAMETERS, INFOS, ["max"])
    assert [each.name for each in found] == ["MPC_XY_VEL_MAX", "GF_MAX_HOR_DIST"]
    assert search_parameters(PARAMETERS, {}, ["nav"])[0].name == "NAV_ACC_RAD"


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("CRUSE", ["MPC_XY_CRUISE"]),
        ("mpc_vel", ["MPC_XY_VEL_MAX"]),
        ("ACTION", ["GF_ACTION"]),
        ("FOO", []),  # letters of no name
        ("NCD", []),  # letters of NAV_ACC_RAD in their order
        ("A", []),
    ],
)
def test_only_names_with_the_words_of_another_are_near(name: str, near: list[str]) -> None:
    assert near_names(name, list(INFOS)) == near


def test_description_prints_a_repeated_text_once() -> None:
    info = ParamInfo(help="Maximum distance", details="Maximum distance. Takes effect immediately.")
    assert description(PARAMETERS[0], info).splitlines()[1:] == [
        "  Maximum distance",
        "  Takes effect immediately.",
    ]


@pytest.mark.parametrize("details", ["Maximum distances from home", "... from home", ".5 m at least"])
def test_description_prints_a_longer_text_as_it_is(details: str) -> None:
    info = ParamInfo(help="Maximum distance", details=details)
    assert details in description(PARAMETERS[0], info)
