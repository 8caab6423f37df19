"""``sim-bridge export-mjcf``, and the errors for a missing MuJoCo or plant."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from flightstack.core.contract import Vector3
from flightstack.core.errors import INSTALL_MULTIBODY
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG
from gcs_cli.errors import CliError
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import checked_plan
from sim_bridge.command import run_command as main
from sim_bridge.multibody.mjcf import model_xml
from sim_bridge.multibody.plant import MultibodyPlant
from sim_bridge.plant.plant import InitialState, PlantOptions

SQUARE = Path(__file__).resolve().parents[2] / "missions" / "square.plan"


def test_exported_model_loads_and_stands_on_its_feet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "paper.xml"
    assert main(["export-mjcf", "-o", str(file)]) == 0
    out, table = capsys.readouterr()
    assert out == ""
    assert "battery" in table
    assert "Ix, kg m²                         0.0072          0.0072" in table
    assert list(tmp_path.iterdir()) == [file]
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos[:2]).max() < 1e-9
    assert -1e-3 < data.qpos[2] < 0.0
    assert data.ncon == 4


def test_exported_model_has_the_documented_names(capsys: pytest.CaptureFixture[str]) -> None:
    for scene in ([], ["--scene"]):
        assert main(["export-mjcf", "--vehicle", "x_quad", *scene]) == 0
        model = mujoco.MjModel.from_xml_string(capsys.readouterr().out)
        assert model.body("vehicle").jntnum == 1
        assert model.joint("vehicle").type == mujoco.mjtJoint.mjJNT_FREE
        for number, rotor in enumerate(load_vehicle("x_quad").rotors, start=1):
            joint = model.joint(f"rotor_{number}")
            assert joint.type == mujoco.mjtJoint.mjJNT_HINGE
            assert joint.bodyid == model.body(f"rotor_{number}").id
            # clockwise seen from above: about the downward axis
            assert joint.axis.tolist() == [0.0, 0.0, -float(rotor.spin)]
            x, y, z = rotor.position_frd_m
            assert model.body(f"rotor_{number}").pos.tolist() == [x, -y, -z]


@pytest.mark.parametrize("vehicle", ["paper_quad", "x_quad"])
def test_plain_mujoco_hovers_from_the_keyframe(vehicle: str, capsys: pytest.CaptureFixture[str]) -> None:
    """In plain MuJoCo the controls of the keyframe hold the vehicle and its rotor speeds."""
    assert main(["export-mjcf", "--vehicle", vehicle]) == 0
    model = mujoco.MjModel.from_xml_string(capsys.readouterr().out)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    start, speeds = data.qpos[:7].copy(), data.qvel[6:].copy()
    loaded = load_vehicle(vehicle)
    carried = sum(
        rotor.thrust_coefficient_n_s2 * speed**2
        for rotor, speed in zip(loaded.rotors, speeds.tolist(), strict=True)
    )
    assert carried == pytest.approx(loaded.weight_n, rel=1e-12)
    for _ in range(5000):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos[:7] - start).max() < 1e-8  # measured: 1.4e-11
    assert np.abs(data.qvel[6:] - speeds).max() < 1e-6
    # with 1 N less it sinks
    data.ctrl[0] -= 1.0
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert data.qpos[2] < start[2] - 0.01


@pytest.mark.parametrize("vehicle", ["paper_quad", "x_quad"])
def test_actuators_give_the_accelerations_of_the_plant(vehicle: str) -> None:
    """In a random state, thrusts b·Ω² and the drive torques of the plant give its accelerations."""
    loaded = replace(load_vehicle(vehicle), linear_drag_n_s_m=(0.0, 0.0, 0.0))
    speeds = (300.0, 250.0, 350.0, 280.0)
    wild = InitialState(
        Vector3(1.0, 2.0, -30.0), Vector3(3.0, -1.0, 2.0), Vector3(0.4, -0.3, 1.0), Vector3(2.0, -3.0, 1.0)
    )
    plant = MultibodyPlant(loaded, PlantOptions(initial=wild, limits=False, battery=None))
    plant.set_rotor_speeds(speeds)
    command = np.zeros(8)
    command[:4] = np.add(speeds, (40.0, -20.0, 10.0, 30.0))
    plant.advance(command, ARMED_FLAG, 3)
    plant.acceleration_ned_m_s2()
    flown = plant.data
    model = mujoco.MjModel.from_xml_string(model_xml(loaded))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = flown.qpos, flown.qvel
    for number, rotor in enumerate(loaded.rotors, start=1):
        speed = data.qvel[5 + number]
        data.actuator(f"thrust_{number}").ctrl = rotor.thrust_coefficient_n_s2 * speed**2
        data.actuator(f"drive_{number}").ctrl = flown.qfrc_applied[5 + number]
    model.actuator_ctrllimited[:] = 0  # the plant here has no limits either
    mujoco.mj_forward(model, data)
    assert np.abs(data.qacc[:3]).max() > 1.0
    assert np.abs(data.qacc[6:]).max() > 500.0
    assert np.allclose(data.qacc, flown.qacc, rtol=1e-9, atol=1e-9)


def test_unwritable_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-mjcf", "-o", str(tmp_path / "none" / "x.xml")]) == 1
    assert "cannot be written: No such file or directory" in capsys.readouterr().err


def test_unknown_vehicle_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-mjcf", "--vehicle", "boat"]) == 2
    assert "neither a file nor a built-in vehicle" in capsys.readouterr().err


def test_error_without_mujoco_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sim_bridge.arguments.find_spec", lambda name: None)
    assert main(["--plant", "multibody"]) == 2
    assert capsys.readouterr().err == (f"sim-bridge: the multibody plant needs MuJoCo: {INSTALL_MULTIBODY}\n")
    with pytest.raises(CliError, match="needs MuJoCo: pip install"):
        checked_plan(FlyOptions(SQUARE, plant="multibody"))


def test_error_for_unknown_plant_lists_all_plants(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--plant", "flat"]) == 2
    assert "'flat' is not one of rigid, paper, multibody" in capsys.readouterr().err
