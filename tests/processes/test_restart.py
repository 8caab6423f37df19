"""A vehicle whose process was killed and started again: it has the plans it had, whole, or says why not."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

import pytest

from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link, Message
from flightstack.plan import MissionItem, load_plan
from flightstack.process.state_directory import StateDirectory
from flightstack.transports.udp import UdpSocket
from gcs_cli.clients.mission_client import Done, MissionClient
from tests.support.commands import gcs
from tests.support.process import wait_until
from tests.support.vehicle_processes import LONG_S, VehicleProcesses, vehicle
from tests.support.warm_children import warm_children

MISSIONS = Path(__file__).parents[2] / "missions"
OPTIONS = ("--log", "none", "--state-dir", "state")


def run(there: VehicleProcesses, *words: object) -> str:
    ended = gcs("--connect", there.link, "--timeout", 60, *words)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def kill(there: VehicleProcesses) -> str:
    """Kill the flight stack, and return what it said on stderr."""
    there.stack.send_signal(signal.SIGKILL)
    return there.stack.communicate(timeout=LONG_S)[1]


def downloaded(there: VehicleProcesses, file: Path) -> tuple[list[MissionItem], ...]:
    run(there, "mission", "download", file, "--overwrite")
    plan = load_plan(file)
    return list(plan.items), list(plan.fence), list(plan.rally)


def as_uploaded(name: str) -> tuple[list[MissionItem], ...]:
    plan = load_plan(MISSIONS / name)
    return tuple([item.on_wire() for item in part] for part in (plan.items, plan.fence, plan.rally))


def wait_for_file(path: Path, text: str) -> None:
    """Wait until the file has been saved; a hang guard ends the test if it never is."""
    wait_until(lambda: path.exists() and text in path.read_text())


def test_plans_home_and_parameters_survive_a_kill(tmp_path: Path) -> None:
    with vehicle(tmp_path, *OPTIONS) as there:
        run(there, "mission", "upload", MISSIONS / "fenced_square.plan")
        run(there, "sethome", 47.3978, 8.5456, 489)
        run(there, "param", "set", "MIS_TAKEOFF_ALT", 4.5)
        wait_for_file(tmp_path / "state" / "plans.json", "47.3978")
        wait_for_file(tmp_path / "state" / "vehicle.params", "MIS_TAKEOFF_ALT")
        kill(there)
    with vehicle(tmp_path, *OPTIONS) as there:
        assert downloaded(there, tmp_path / "after.plan") == as_uploaded("fenced_square.plan")
        home = load_plan(tmp_path / "after.plan").home
        assert home is not None
        assert (round(home.latitude_deg, 6), round(home.altitude_m)) == (47.3978, 489)
        assert "4.5" in run(there, "param", "get", "MIS_TAKEOFF_ALT")
        assert kill(there) == ""


def test_a_state_directory_is_held_over_a_reboot(tmp_path: Path) -> None:
    with vehicle(tmp_path, *OPTIONS) as there:
        run(there, "reboot")
        run(there, "status")
        with pytest.raises(ConfigError, match="is in use by another vehicle"):
            StateDirectory(tmp_path / "state", 0).open()
        assert kill(there) == "flightstack: rebooted\n"
    StateDirectory(tmp_path / "state", 0).open()


class Client:
    """A ground station that stops in the middle of an upload."""

    def __init__(self, instance: int) -> None:
        self.socket = UdpSocket("127.0.0.1", 0)
        self.peer = ("127.0.0.1", 18570 + instance)
        self.link = Link(255, 190)
        self.client = MissionClient(Address(1 + instance, 1), Address(255, 190))

    def upload(self, items: tuple[MissionItem, ...], until: int) -> None:
        """Upload ``items``; stop when the vehicle asks for number ``until``, or has taken all."""
        self.client.start_upload(items)
        self.send([mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)])
        while True:
            now_s = time.monotonic()
            self.send(self.client.poll(now_s))
            for data, _ in self.socket.receive():
                for message in self.link.decode(data):
                    kind = message.get_type()
                    if kind in ("MISSION_REQUEST", "MISSION_REQUEST_INT") and message.seq == until:
                        return
                    self.client.receive(message, now_s)
            if self.client.result is not None:
                assert isinstance(self.client.result, Done)
                return
            self.socket.wait(0.1)

    def send(self, messages: list[Message]) -> None:
        for message in messages:
            self.socket.send(self.link.encode(message), self.peer)


@pytest.mark.parametrize("until", [1, 5, 99])
def test_a_kill_in_an_upload_leaves_the_old_plan_or_the_new_one(tmp_path: Path, until: int) -> None:
    old, new = as_uploaded("square.plan")[0], as_uploaded("every_item.plan")[0]
    with vehicle(tmp_path, *OPTIONS) as there:
        run(there, "mission", "upload", MISSIONS / "square.plan")
        wait_for_file(tmp_path / "state" / "plans.json", "plans")
        client = Client(there.instance)
        client.upload(tuple(new), until)
        kill(there)
        client.socket.close()
    with vehicle(tmp_path, *OPTIONS) as there:
        after = downloaded(there, tmp_path / "after.plan")[0]
        assert after == old or (until == 99 and after == new)
        assert kill(there) == ""


def test_a_damaged_file_is_told_and_kept_and_nothing_of_it_is_flown(tmp_path: Path) -> None:
    (tmp_path / "state").mkdir()
    kept = tmp_path / "state" / "plans.json"
    kept.write_text('{"fileType": "flightstack plans", "version": 1, "chec')
    with vehicle(tmp_path, *OPTIONS) as there:
        texts = json.loads(run(there, "status", "--json"))
        assert any("Plans not restored" in str(text) for text in texts["texts"]), texts
        assert downloaded(there, tmp_path / "after.plan") == ([], [], [])
        run(there, "mission", "upload", MISSIONS / "square.plan")
        wait_for_file(kept, '"checksum"')
        errors = kill(there)
    assert errors == (
        "flightstack: warning: plans not restored: state/plans.json: is damaged or truncated; "
        "the file is now state/plans.refused.json\n"
    )
    assert (tmp_path / "state" / "plans.refused.json").read_text().endswith('"chec')


def test_gcs_fly_inherits_no_plan(tmp_path: Path) -> None:
    with vehicle(tmp_path, *OPTIONS) as there:
        run(there, "mission", "upload", MISSIONS / "fenced_square.plan")
        wait_for_file(tmp_path / "state" / "plans.json", "plans")
        assert there.stack.poll() is None
        instance = there.instance
        kill(there)
    with warm_children():
        flown = gcs("fly", MISSIONS / "hop.plan", "--instance", instance, "--out", tmp_path / "run")
    assert flown.returncode == 0, flown.stderr
    assert "no state kept" in (tmp_path / "run" / "flightstack.log").read_text()
