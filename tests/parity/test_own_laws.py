"""The example's guidance, position law and mixer fly in Python, and in generated C with the same bits."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from flightstack.control.attitude_pid import CONTROLLER as ATTITUDE_PID
from flightstack.control.control_law import ControlLaw
from flightstack.control.controller import Controller
from flightstack.control.controller_loading import form_problem, load_controller
from flightstack.control.loop_parameters import LoopParameters, loop_numbers
from flightstack.firmware.c_loops import HostLoops
from flightstack.firmware.law_parity import law_parity
from flightstack.firmware.law_tree import firmware_for
from flightstack.firmware.numbers import default_numbers, laws_with
from flightstack.firmware.toolchain.build import host_library
from flightstack.params.gains_file import BUILT_IN, open_gains
from flightstack.params.vehicle import load_vehicle
from tests.firmware.core_support import PARTS, same_bits
from tests.parity.recorded_loops import record
from tests.support.plugin_site import ROOT, install
from tests.support.truth import World

LAWS = ROOT / "examples" / "own_laws"


@pytest.fixture(scope="module", autouse=True)
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The example, installed for this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(install(tmp_path_factory.mktemp("site"), LAWS)))
        patch.delitem(sys.modules, "own_laws", raising=False)
        importlib.invalidate_caches()
        yield


def cascade() -> Controller:
    return load_controller("cascade")


def test_own_laws_fly_in_c_with_the_bits_of_python() -> None:
    flight = record("square.plan", controller="cascade", vehicle="x_quad", wind=(3.0, 1.0, 0.0), gust=1.0)
    with firmware_for(cascade()):
        executor = HostLoops(host_library("double"), flight.numbers)
    made = np.zeros_like(flight.outputs)
    for tick, flags in enumerate(flight.flags):
        executor.input[:13], executor.input[13:24] = flight.states[tick], flight.setpoints[tick]
        executor.input[24:] = flight.targets[tick]
        executor.step(int(flags))
        made[tick] = executor.output[:31]
        assert executor.output[31] == flight.status[tick], tick
    assert len(flight.flags) > 10_000
    for quantity, part in PARTS.items():
        assert same_bits(made[:, part], flight.outputs[:, part]), quantity


def test_own_laws_have_the_bits_of_python_on_random_steps() -> None:
    assert law_parity(cascade(), 200) == (200 * len(cascade().own_laws), 0)


def test_parameters_of_own_laws_are_the_vehicles() -> None:
    world = World(controller="cascade", params={"LEASH_LENGTH": 0.5, "CAS_POS_P": 1.0})
    loops = world.engine.stack.loops
    assert (loops.get_parameter("LEASH_LENGTH"), loops.get_parameter("CAS_POS_P")) == (0.5, 1.0)
    names = {spec.name for spec in loops.parameter_specs}
    assert {"LEASH_LENGTH", "CAS_VEL_I", "PID_ROLL_P", "MPC_TILTMAX_AIR"} <= names
    assert not any(name.startswith("POS_") for name in names)  # of the position law that does not fly


def test_table_of_an_own_law_is_read_from_the_gains_file(tmp_path: Path) -> None:
    path = tmp_path / "gains.toml"
    tuned = (BUILT_IN / "tuned.toml").read_text(encoding="utf-8")
    path.write_text(f"{tuned}\n[position_cascade]\nposition_gain = 2.5\n[guidance_leash]\nlength_m = 7.0\n")
    numbers = loop_numbers(load_vehicle("x_quad"), cascade(), open_gains(str(path)), 0.5)
    assert numbers.laws["position"][0] == 2.5
    assert numbers.laws["position"][6] == 0.5
    assert numbers.laws["guidance"].tolist() == [7.0]
    memories = {role: np.array(law.initial_memory) for role, law in cascade().laws.items()}
    parameters = LoopParameters(numbers, cascade(), memories)
    parameters.set("MPC_TILTMAX_AIR", 20.0)
    assert numbers.laws["position"][6] == np.radians(20.0)
    assert parameters.get("MPC_TILTMAX_AIR") == 20.0


def test_firmware_has_a_number_for_every_parameter_of_an_own_law() -> None:
    numbers = default_numbers(laws_with(cascade()))
    assert numbers["CAS_POS_P"] == 1.6
    assert numbers["FS_POS_4"] == load_vehicle("paper_quad").mass_kg
    assert {"FS_GUIDANCE", "FS_POSITION", "FS_MIXING", "POS_XY_P"} <= numbers.keys()
    assert "FS_POS_6" not in numbers  # the tilt, which follows MPC_TILTMAX_AIR


def with_law(**laws: ControlLaw) -> Controller:
    return cascade()._replace(**laws)


def test_a_law_with_a_built_in_name_is_refused() -> None:
    law = cascade().position._replace(name="pid")
    problem = form_problem("cascade", with_law(position=law))
    assert (
        problem == "has a law of position that needs another name than 'pid', which is that of a built-in law"
    )


def test_two_laws_with_one_parameter_are_refused() -> None:
    guidance = cascade().guidance
    assert guidance.tunables is not None
    twin = guidance._replace(tunables=(guidance.tunables[0]._replace(name="CAS_POS_P"),))
    assert form_problem("cascade", with_law(guidance=twin)) == "declares the parameter CAS_POS_P in two laws"


def test_a_member_that_is_no_law_is_refused() -> None:
    problem = form_problem("cascade", with_law(mixer=3))  # type: ignore[arg-type]
    assert problem == "has a law of mixer that is not a ControlLaw"


def test_an_attitude_law_alone_flies_with_the_built_in_laws() -> None:
    assert load_controller("pid") == Controller("pid", ATTITUDE_PID)
