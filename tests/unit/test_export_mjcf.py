"""``sim-bridge export-mjcf``, and what the command line says where MuJoCo or the plant is missing."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from flightstack.params.vehicle import load_vehicle
from gcs_cli.errors import CliError
from gcs_cli.fly_options import FlyOptions, checked_plan
from sim_bridge.__main__ import main

SQUARE = Path(__file__).resolve().parents[2] / "missions" / "square.plan"


def test_the_file_loads_and_stands_on_its_feet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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


def test_names_are_those_that_are_promised(capsys: pytest.CaptureFixture[str]) -> None:
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


def test_a_file_that_cannot_be_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-mjcf", "-o", str(tmp_path / "none" / "x.xml")]) == 2
    assert "cannot be written: No such file or directory" in capsys.readouterr().err


def test_an_unknown_vehicle(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-mjcf", "--vehicle", "boat"]) == 2
    assert "neither a file nor a built-in vehicle" in capsys.readouterr().err


def test_without_mujoco_both_commands_say_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in ("sim_bridge.arguments", "gcs_cli.fly_options"):
        monkeypatch.setattr(f"{module}.find_spec", lambda name: None)
    assert main(["--plant", "multibody"]) == 2
    assert capsys.readouterr().err == (
        "sim-bridge: the multibody plant needs MuJoCo: pip install 'flightstack[multibody]'\n"
    )
    with pytest.raises(CliError, match="needs MuJoCo: pip install"):
        checked_plan(FlyOptions(SQUARE, plant="multibody"))


def test_an_unknown_plant_is_told_all_that_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--plant", "flat"]) == 2
    assert "'flat' is not one of rigid, paper, multibody" in capsys.readouterr().err
