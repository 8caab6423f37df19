"""Faults planted into the C loops: ``gcs pil replay`` finds each of them, and passes rounding with room."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcs_cli.pil.excitation import excitation
from gcs_cli.pil.replay_run import prepared
from tests.support.tools import NIGHTLY
from tests.support.truth import World
from tools.generated import ROOT
from tools.pil_faults.faults import BACKSTEPPING, PID, Fault
from tools.pil_faults.page import named_check
from tools.pil_faults.planted import PlantedCore, checks_of, faults, findings, setup_of

pytestmark = pytest.mark.long

PAGE = ROOT / "docs" / "reference" / "pil-faults.md"


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> PlantedCore:
    return PlantedCore(tmp_path_factory.mktemp("planted") / "firmware")


@pytest.mark.parametrize("controller", [PID, BACKSTEPPING])
def test_rounding_passes_stage_by_stage_with_room(core: PlantedCore, controller: str) -> None:
    setup = setup_of(controller)
    checks = list(checks_of(core.library(), setup, excitation(setup)))
    assert len(checks) == 3 * 4  # largest, rms and slope of four stages
    for check in checks:
        assert check.passed
        assert check.margin is None or check.margin > 3.0, check  # measured 3.9 and more


def test_replay_of_the_excitation_finds_every_planted_fault(core: PlantedCore) -> None:
    """By day one fault in four; NIGHTLY=1 plants all of them."""
    rows = PAGE.read_text(encoding="utf-8")
    planted = faults()
    assert len(planted) == rows.count("\n| ") - rows.count("| fault |")
    for finding in findings(core, planted if NIGHTLY else planted[::4]):
        title = finding.fault.title
        assert finding.excess > 10.0, f"{title}: {finding.failed}"  # measured 76 and more
        assert (
            f"{title}` | {named_check(finding)} |" in rows or f"{title} | {named_check(finding)} |" in rows
        ), f"{title}: {PAGE.name} is stale: run `python -m tools.pil_faults`"


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("PID_ROLL_P", 1.025),
        ("PID_ROLL_I", 1.1),
        ("PID_ROLL_D", 1.001),
        ("PID_YAW_I", 1.01),
        ("POS_XY_I", 1.01),
    ],
)
def test_replay_of_a_flight_finds_gain_errors(
    core: PlantedCore, gusty_flight: Path, name: str, factor: float
) -> None:
    replay = prepared(gusty_flight, None)
    fault = Fault(name, "", PID, name=name, factor=factor)
    checks = list(checks_of(core.library(), replay.setup, replay.record, fault))
    assert max(check.measured / check.limit for check in checks if check.limit) > 5.0  # measured 10 and more


def test_rounding_in_a_flight_passes_with_room(core: PlantedCore, gusty_flight: Path) -> None:
    replay = prepared(gusty_flight, None)
    for check in checks_of(core.library(), replay.setup, replay.record):
        assert check.passed
        assert check.margin is None or check.margin > 3.0, check  # measured 3.9 and more


@pytest.fixture(scope="module")
def gusty_flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    world = World(loops="python", drag=True, wind=(4.0, 1.0, 0.0), gust=1.0)
    world.upload("square.plan")
    assert world.fly().completed
    path = tmp_path_factory.mktemp("flown") / "flight.ulg"
    path.write_bytes(world.engine.logs[-1].content)
    return path
