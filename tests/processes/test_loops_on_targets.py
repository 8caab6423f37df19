"""``--loops`` with real processes: a host program behind a pseudo-terminal, an emulated Cortex-M4F, and bad ends."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from flightstack.firmware.toolchain.build import host_program
from flightstack.testing.instances import free_instance
from flightstack.transports.serial_port import SerialPort
from tests.support.commands import flightstack_command, gcs
from tests.support.process import await_output, ends_of
from tests.support.warm_children import warm_children

LONG_S = 180.0  # a bound for a busy machine that compiles kernels and firmware anew
HOP = Path(__file__).parents[2] / "missions" / "hop.plan"
TOPICS = ("attitude_reference", "wrench", "rotor_speeds", "vehicle_attitude_setpoint", "vehicle_attitude")


def gcs_fly(out: Path, *flags: str) -> list[str]:
    fly = [sys.executable, "-m", "gcs_cli", "fly", str(HOP), "--out", str(out)]
    return [*fly, "--instance", str(free_instance()), *flags]


def flown(out: Path, *flags: str) -> ULog:
    with warm_children():
        done = gcs(*gcs_fly(out, *flags)[3:])
    assert done.returncode == 0, f"{done.stdout}{done.stderr}{(out / 'flightstack.log').read_text()}"
    return ULog(str(out / "flight.ulg"))


def check(*flags: str) -> tuple[int, str]:
    """Return exit code and standard error of ``flightstack --check``."""
    done = flightstack_command("--check", *flags)
    return done.returncode, done.stderr


def program_below(pid: int) -> int:
    """Return the process id of the host program that a descendant of ``pid`` has started."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                status = (entry / "stat").read_text()
            except OSError:  # it ended meanwhile
                continue
            name, _, rest = status.partition("(")[2].rpartition(")")
            parents[int(entry.name)] = (name, int(rest.split()[1]))
    for child, (name, parent) in parents.items():
        if name.startswith("fs_host") and parents.get(parent, ("", 0))[1] == pid:
            return child
    raise AssertionError("there is no host program")


@pytest.fixture(scope="module")
def in_c(tmp_path_factory: pytest.TempPathFactory) -> ULog:
    return flown(tmp_path_factory.mktemp("c") / "run", "--loops", "c")


@pytest.mark.parametrize(("loops", "unit"), [("host", "ns"), ("emulated", "instructions")])
def test_a_target_flies_the_bits_of_c_here(tmp_path: Path, in_c: ULog, loops: str, unit: str) -> None:
    out = tmp_path / "run"
    log = flown(out, "--loops", loops)
    for topic in TOPICS:
        here, there = in_c.get_dataset(topic).data, log.get_dataset(topic).data
        for name in here:
            assert np.array_equal(here[name], there[name], equal_nan=True), f"{topic}.{name}"
    assert log.msg_info_dict["loops"] == loops
    told = json.loads((out / "pil-link.json").read_text())
    assert told["ending"] is None
    assert told["identity"]["cost_unit"] == unit
    assert told["identity"]["source_hash"] in log.msg_info_dict["ver_loops"]
    steps = np.load(out / "pil-steps.npz")["steps"]
    idle = 32
    assert len(steps) == told["steps"] == np.count_nonzero(log.get_dataset("wrench").data["status"] != idle)
    assert told["status"]["steps"] == len(steps)  # nothing but what was flown
    assert (steps["cost"][:, 3] >= steps["cost"][:, 1]).all()
    assert json.loads((out / "summary.json").read_text())["loops"] == loops


def test_short_steps_fly_the_same_flight_and_log_fewer_stages(tmp_path: Path) -> None:
    """On the true state: the link carries the steps of the loops alone, no measurements."""
    in_c = flown(tmp_path / "c", "--loops", "c", "--state", "truth")
    log = flown(tmp_path / "run", "--loops", "host,short", "--state", "truth")
    for topic in ("rotor_speeds", "vehicle_attitude_setpoint", "vehicle_attitude", "vehicle_local_position"):
        here, there = in_c.get_dataset(topic).data, log.get_dataset(topic).data
        assert all(np.array_equal(here[name], there[name], equal_nan=True) for name in here), topic
    wrench, idle = log.get_dataset("wrench").data, 32
    assert np.isnan(wrench["torque_n_m[0]"][wrench["status"] != idle]).all()
    link = json.loads((tmp_path / "run" / "pil-link.json").read_text())
    assert (
        link["link"]["octets_sent"] / link["steps"] < 90
    )  # 48 in an inner tick, at most 116 in an outer one
    assert link["link"]["octets_received"] / link["steps"] < 70  # 40, 60 or 56


def test_a_target_that_dies_in_flight_ends_it_with_a_sentence(tmp_path: Path) -> None:
    out = tmp_path / "run"
    process = subprocess.Popen(
        gcs_fly(out, "--loops", "host", "--speed", "1"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        await_output(process, "Takeoff detected")
        os.kill(program_below(process.pid), signal.SIGKILL)
        _, said = process.communicate(timeout=LONG_S)
    finally:
        process.kill()
    assert process.returncode == 3, said
    assert "flightstack ended with code 3" in said
    assert "connection lost" in (out / "flightstack.log").read_text()
    assert "connection lost" in json.loads((out / "pil-link.json").read_text())["ending"]


def test_who_ends_a_flight_leaves_no_program_behind(tmp_path: Path) -> None:
    out = tmp_path / "run"
    process = subprocess.Popen(
        gcs_fly(out, "--loops", "host", "--speed", "1"), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    try:
        await_output(process, "Takeoff detected")
        with ends_of(program_below(process.pid)):
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=LONG_S)
    finally:
        process.kill()


@pytest.mark.parametrize(
    ("loops", "sentence"),
    [
        ("serial:/dev/no-such-port", ": no such device"),
        ("serial:/dev/null:9600", " is not a serial port"),
        ("serial:/", " is a directory"),
        ("fast", " is not one of python, c, host, emulated and serial:DEVICE[:BAUD]"),
    ],
)
def test_what_cannot_fly_is_said_in_one_sentence(loops: str, sentence: str) -> None:
    assert check("--loops", loops) == (2, f"flightstack: --loops: {loops}{sentence}\n")


def test_a_target_and_real_time_do_not_go_together() -> None:
    code, said = check("--loops", "host", "--clock", "realtime")
    assert code == 2
    assert "require lockstep" in said


def test_a_port_on_which_nobody_answers_is_given_up() -> None:
    ours, theirs = pty.openpty()
    try:
        code, said = check("--loops", f"serial:{os.ttyname(theirs)}:921600")
    finally:
        os.close(ours)
        os.close(theirs)
    assert code == 3
    assert "at 921600 baud did not answer 20 requests for FS_PIL_IDENTITY" in said
    assert said.count("\n") == 1


def test_a_port_that_another_program_uses_is_refused() -> None:
    ours, theirs = pty.openpty()
    name = os.ttyname(theirs)
    port = SerialPort(name, 115_200)
    try:
        code, said = check("--loops", f"serial:{name}")
    finally:
        port.close()
        os.close(ours)
        os.close(theirs)
    assert (code, said) == (2, f"flightstack: --loops: serial:{name}: in use by another program\n")


def test_the_firmware_behind_a_serial_port_flies(tmp_path: Path, in_c: ULog) -> None:
    """As a board would: the flight stack opens a device by its name."""
    program = subprocess.Popen(
        [str(host_program())], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert program.stdout is not None
        device = program.stdout.readline().strip()
        log = flown(tmp_path / "run", "--loops", f"serial:{device}:921600")
        assert program.wait(LONG_S) == 0  # it ends when its line is closed
    finally:
        program.kill()
        program.communicate()
    here, there = (one.get_dataset("rotor_speeds").data for one in (in_c, log))
    assert all(np.array_equal(here[name], there[name], equal_nan=True) for name in here)
