"""Parameter files: nothing is lost, whatever happens to the file; what cannot be read is one sentence."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core import atomic_file
from flightstack.core.errors import ConfigError
from flightstack.core.port_numbers import GROUND
from flightstack.params.config import StackConfig
from flightstack.params.param_file import (
    ParamFile,
    ParamLine,
    begin_param_file,
    format_params,
    load_into,
    parse_params,
    read_param_file,
)
from flightstack.params.spec import ParamSpec
from flightstack.params.store import ParamStore
from flightstack.process.assembly import build
from flightstack.process.state_directory import FileSaver
from flightstack.services.routing.peer import PeerAddress
from tests.support.commands import flightstack_command

ROOT = Path(__file__).resolve().parents[2]
SPECS = (
    ParamSpec("FS_GAIN", 1.0 / 3.0, 0.0, 10.0, "", "Gain"),
    ParamSpec("FS_MODE", 0, 0, 5, "", "Mode", True, choices=((0, "None"), (3, "Land"), (5, "End"))),
    ParamSpec("FS_SPEED", 4.0, 0.1, 20.0, "m/s", "Speed"),
)

names = st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_", min_size=1, max_size=16)
values = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(2**31), 2**31 - 1)


@given(st.dictionaries(names, values), st.integers(1, 250))
def test_what_is_written_is_read(parameters: dict[str, float], system_id: int) -> None:
    lines = [ParamLine(name, value, isinstance(value, int)) for name, value in parameters.items()]
    read = parse_params(format_params(lines, system_id), "file")
    assert {item.name: item.value for item in read} == parameters
    assert all(isinstance(item.value, int) == item.is_integer for item in read)


@given(st.dictionaries(names, values, min_size=1), st.data())
def test_truncated_parameter_file_is_refused(parameters, data) -> None:
    lines = [ParamLine(name, value, isinstance(value, int)) for name, value in parameters.items()]
    text = format_params(lines)
    cut = data.draw(st.integers(text.index("# Stack: flightstack\n") + 21, len(text) - 2))
    with pytest.raises(ConfigError):
        parse_params(text[:cut], "file")


@given(st.text(max_size=300) | st.text("#\t19FS_GAIN.-e\n", max_size=100))
def test_any_text_parses_or_raises_one_sentence(text: str) -> None:
    said = ""
    try:
        read = parse_params(text, "file")
    except ConfigError as error:
        read, said = [], str(error)
    assert "\n" not in said
    assert all(1 <= len(item.name) <= 16 for item in read)


BAD = {
    "spaces for tabs": ("1 1 FS_SPEED 5 9", "has 1 columns between tabs, expected 5"),
    "a column too many": ("1\t1\tFS_SPEED\t5\t9\t", "has 6 columns between tabs, expected 5"),
    "half a line": ("1\t1\tFS_SPE", "has 3 columns between tabs, expected 5"),
    "vehicle": ("x\t1\tFS_SPEED\t5\t9", "vehicle 'x' and component '1' must be numbers"),
    "digits of another script": ("١\t1\tFS_SPEED\t5\t9", "contains characters that are not ASCII"),
    "other component": (
        "1\t25\tFS_SPEED\t5\t9",
        "FS_SPEED belongs to component 25, not to the autopilot, 1",
    ),
    "name": ("1\t1\tFS SPEED\t5\t9", "'FS SPEED' is not a parameter name"),
    "long name": ("1\t1\tA2345678901234567\t5\t9", "'A2345678901234567' is not a parameter name"),
    "value": ("1\t1\tFS_SPEED\tfast\t9", "FS_SPEED: 'fast' is not a number"),
    "not finite": ("1\t1\tFS_SPEED\tnan\t9", "FS_SPEED: 'nan' is not a number"),
    "underscore": ("1\t1\tFS_SPEED\t1_0\t9", "FS_SPEED: '1_0' is not a number"),
    "huge": ("1\t1\tFS_MODE\t1e999\t6", "FS_MODE: '1e999' is not a number"),
    "type": ("1\t1\tFS_SPEED\t5\t11", "FS_SPEED: '11' is not a numeric MAV_PARAM_TYPE"),
    "fraction": ("1\t1\tFS_MODE\t0.5\t6", "FS_MODE: '0.5' is not a whole number, as type 6 demands"),
    "real for an integer": ("1\t1\tFS_MODE\t3\t9", "FS_MODE: is an integer, type 6, in the vehicle"),
    "integer for a real": ("1\t1\tFS_SPEED\t3\t6", "FS_SPEED: is a real number, type 9, in the vehicle"),
    "range": ("1\t1\tFS_SPEED\t50\t9", "FS_SPEED: 50 is outside 0.1 to 20 m/s"),
    "no such choice": ("1\t1\tFS_MODE\t4\t6", "FS_MODE: 4 is not one of 0, 3, 5"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_line_that_cannot_be_is_a_sentence_with_file_and_line(tmp_path: Path, name: str) -> None:
    row, sentence = BAD[name]
    path = tmp_path / "my.params"
    path.write_text(f"# a comment\n1\t1\tFS_GAIN\t2.5\t9\n\n{row}\n", encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_into(ParamStore(SPECS), path)
    assert str(error.value).startswith(f"{path}: line 4: ")
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)


def test_a_parameter_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="line 2: FS_GAIN is already set in line 1"):
        parse_params("1\t1\tFS_GAIN\t2.5\t9\n1\t1\tFS_GAIN\t2.5\t9\n", "f")


def test_no_file_is_no_parameters_and_anything_else_is_an_error(tmp_path: Path) -> None:
    assert read_param_file(tmp_path / "none.params") == []
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="is not a text file"):
        read_param_file(tmp_path / "binary")
    with pytest.raises(ConfigError, match="cannot be read: Is a directory"):
        read_param_file(tmp_path)


def test_a_file_of_qgroundcontrol_is_read(tmp_path: Path) -> None:
    path = tmp_path / "qgc.params"
    path.write_text(
        "# Onboard parameters for Vehicle 3\r\n#\r\n# Stack: PX4 Pro\r\n# Vehicle-Id Component-Id Name Value Type\r\n"
        "3\t1\tFS_GAIN\t0.349999994039535522\t9\r\n3\t1\tFS_MODE\t3\t6\r\n3\t1\tSYS_AUTOSTART\t4001\t6\r\n"
    )
    store = ParamStore(SPECS)
    loaded = load_into(store, path)
    assert store.values() == {"FS_GAIN": 0.35, "FS_MODE": 3, "FS_SPEED": 4.0}
    assert loaded.unknown == ("SYS_AUTOSTART",)
    assert loaded.warning(path) == f"{path}: not used by this vehicle and controller, but kept: SYS_AUTOSTART"


def test_saves_changed_and_unknown_but_no_overridden_parameters(tmp_path: Path) -> None:
    path = tmp_path / "my.params"
    path.write_text("1\t1\tLQR_Q\t2.5\t9\n1\t1\tFS_SPEED\t5.5\t9\n1\t1\tFS_GAIN\t2.0\t9\n")
    store = ParamStore(SPECS)
    loaded = load_into(store, path)
    store.override("FS_SPEED", 9.0)
    store.override("FS_MODE", 5)
    store.reset(["FS_GAIN"])
    file = ParamFile(path, 7, loaded)
    file.save(store)
    assert [line for line in path.read_text().splitlines() if not line.startswith("#")] == [
        "7\t1\tFS_SPEED\t5.5\t9",
        "7\t1\tLQR_Q\t2.5\t9",
    ]
    store.set("FS_SPEED", 9.0)
    file.save(store)
    assert {item.name: item.value for item in read_param_file(path)} == {"FS_SPEED": 9.0, "LQR_Q": 2.5}


def test_two_vehicles_with_one_file_keep_each_other_s_changes(tmp_path: Path) -> None:
    """Each wrote all that it knew: the second vehicle's write removed what the first had changed."""
    path = tmp_path / "my.params"
    path.write_text("1\t1\tLQR_Q\t2.5\t9\n1\t1\tFS_GAIN\t2.0\t9\n")
    stores = [ParamStore(SPECS) for _ in range(2)]
    files = [ParamFile(path, 1 + index, load_into(store, path)) for index, store in enumerate(stores)]

    def change(index: int, name: str, value: float) -> dict[str, float]:
        stores[index].set(name, value)
        files[index].save(stores[index])
        return {item.name: item.value for item in read_param_file(path)}

    assert change(0, "FS_SPEED", 5.0) == {"LQR_Q": 2.5, "FS_GAIN": 2.0, "FS_SPEED": 5.0}
    assert change(1, "FS_MODE", 3) == {"LQR_Q": 2.5, "FS_GAIN": 2.0, "FS_SPEED": 5.0, "FS_MODE": 3}
    assert change(1, "FS_SPEED", 7.0)["FS_SPEED"] == 7.0
    assert change(0, "FS_GAIN", 1.0 / 3.0) == {"LQR_Q": 2.5, "FS_SPEED": 7.0, "FS_MODE": 3}
    path.unlink()
    assert change(1, "FS_GAIN", 4.0) == {"LQR_Q": 2.5, "FS_SPEED": 7.0, "FS_MODE": 3, "FS_GAIN": 4.0}


def test_a_file_damaged_during_a_run_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "my.params"
    path.write_text("1\t1\tFS_GAIN\t2.0\t9\n")
    store = ParamStore(SPECS)
    file = ParamFile(path, 1, load_into(store, path))
    saver = FileSaver(lambda: file.save(store), "not saved")
    path.write_text("half a line")
    store.set("FS_SPEED", 5.0)
    saver.save()
    assert (
        saver.take_error() == f"not saved: {path}: line 1: has 1 columns between tabs, expected 5: vehicle, "
        "component, name, value, type"
    )
    assert path.read_text() == "half a line"


def test_processes_that_save_to_one_file_lose_no_parameter(tmp_path: Path) -> None:
    path = tmp_path / "my.params"
    path.write_text("")
    script = (
        "import pathlib, sys\n"
        "from flightstack.params.param_file import ParamFile\n"
        "from flightstack.params.spec import ParamSpec\n"
        "from flightstack.params.store import ParamStore\n"
        "names = [f'{sys.argv[1]}_{number}' for number in range(40)]\n"
        "store = ParamStore([ParamSpec(name, 0.0, 0.0, 9.0, '', '') for name in names])\n"
        f"file = ParamFile(pathlib.Path({str(path)!r}), 1)\n"
        "for name in names:\n    store.set(name, 1.0)\n    file.save(store)\n"
    )
    writers = [subprocess.Popen([sys.executable, "-c", script, name], cwd=ROOT) for name in ("A", "B")]
    assert [writer.wait() for writer in writers] == [0, 0]
    assert len(read_param_file(path)) == 80


@pytest.mark.parametrize("failing", ["fsync", "replace"])
def test_a_crash_while_writing_leaves_the_old_file(tmp_path: Path, monkeypatch, failing: str) -> None:
    path = tmp_path / "my.params"
    store = ParamStore(SPECS)
    store.set("FS_SPEED", 5.0)
    ParamFile(path, 1).save(store)
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    if failing == "fsync":
        monkeypatch.setattr(atomic_file.os, "fsync", fail)
    else:
        monkeypatch.setattr(Path, "replace", fail)
    store.set("FS_SPEED", 6.0)
    with pytest.raises(OSError, match="No space"):
        ParamFile(path, 1).save(store)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_the_process_may_die_between_writing_and_renaming(tmp_path: Path) -> None:
    """Killed for good, not by an exception: the temporary file stays, the old one is whole, the next start reads it."""
    path = tmp_path / "my.params"
    path.write_text("1\t1\tFS_SPEED\t5.0\t9\n")
    script = (
        "import os, pathlib\n"
        "from flightstack.core.atomic_file import write_text_atomically\n"
        "pathlib.Path.replace = lambda *_: os._exit(9)\n"
        f"write_text_atomically(pathlib.Path({str(path)!r}), 'half')\n"
    )
    assert subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=False).returncode == 9
    assert len(list(tmp_path.iterdir())) == 2
    store = ParamStore(SPECS)
    load_into(store, path)
    assert store.value("FS_SPEED") == 5.0
    ParamFile(path, 1).save(store)
    assert read_param_file(path)[0].value == 5.0


def saver_of(store: ParamStore, path: Path) -> FileSaver:
    file = ParamFile(path, 1)
    saver = FileSaver(lambda: file.save(store), f"the parameters are not saved to {path}")
    store.subscribe(lambda *_: saver.change())
    return saver


def test_the_saver_writes_changes_and_the_next_start_has_them(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "my.params"
    store = ParamStore(SPECS)
    saver = saver_of(store, path)
    saver.close()
    assert not path.exists(), "nothing changed, nothing is written"
    saver = saver_of(store, path)
    for speed in range(1, 20):
        store.set("FS_SPEED", float(speed))
    store.set("FS_MODE", 3)
    saver.close()
    assert saver.take_error() is None
    after = ParamStore(SPECS)
    load_into(after, path)
    assert after.values() == store.values()


def test_a_disk_that_fails_is_reported_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "my.params"
    store = ParamStore(SPECS)
    saver = saver_of(store, path)
    store.set("FS_SPEED", 5.0)
    saver.close()
    assert saver.take_error() == f"the parameters are not saved to {path}: File exists"
    assert saver.take_error() is None


def test_series_of_failed_saves_is_reported_once() -> None:
    errors: list[OSError | None] = [OSError(28, "full"), OSError(28, "full"), None, OSError(5, "broken")]

    def write() -> None:
        error = errors.pop(0)
        if error is not None:
            raise error

    saver = FileSaver(write, "not saved")
    said = []
    for _ in range(4):
        saver.save()
        said.append(saver.take_error())
    assert said == ["not saved: full", None, None, "not saved: broken"]


def test_a_saver_goes_on_after_an_unexpected_error() -> None:
    errors: list[Exception] = [ValueError("not a number"), ValueError("not a number")]
    written = threading.Event()

    def write() -> None:
        if errors:
            failed.release()
            raise errors.pop()
        written.set()

    failed = threading.Semaphore(0)
    saver = FileSaver(write, "not saved")
    for _ in range(2):
        saver.change()
        failed.acquire()
    saver.change()
    written.wait()
    saver.close()
    assert saver.take_error() == "not saved: ValueError: not a number"
    assert saver.take_error() is None


# ---------------------------------------------------------------------- the vehicle


def test_order_of_precedence(tmp_path: Path) -> None:
    """Default, gains file, parameter file, --param."""
    path = tmp_path / "my.params"
    path.write_text("1\t1\tPOS_XY_P\t6.5\t9\n1\t1\tMPC_XY_CRUISE\t5.0\t9\n1\t1\tMAV_SYS_ID\t42\t6\n")
    stack = build(StackConfig(params_file=str(path), params=("MPC_XY_CRUISE=3",)), lambda: None)
    backend = stack.loops
    assert backend.get_parameter("POS_XY_P") == 6.5
    assert backend.get_parameter("POS_XY_I") == 3.125  # tuned.toml
    assert stack.now.behaviour.cruise_speed_m_s == 3.0
    assert stack.parts.navigator.params.cruise_speed_m_s == 3.0
    assert stack.now.behaviour.climb_speed_m_s == 2.5
    stack.ground.add_peer(PeerAddress(GROUND, "memory", 0), permanent=True)
    frames = [data for _, data in stack.ground.poll(0.0)]
    assert {frame[5] for frame in frames} == {42}, "the system id in MAVLink 2's header"


def test_a_check_refuses_a_damaged_file_in_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "my.params"
    path.write_text("1\t1\tMPC_XY_CRUISE\t50\t9\n")
    done = flightstack_command("--check", "--params", path)
    assert done.returncode == 2
    sentence = f"{path}: line 1: MPC_XY_CRUISE: 50 is outside 0.1 to 20 m/s"
    assert done.stderr == f"flightstack: {sentence}\n"
    good = flightstack_command("--check", "--params", "none", "--param", "PID_ROLL_P=100")
    assert good.returncode == 0


def test_a_file_that_is_named_and_missing_is_mentioned_and_begun(tmp_path: Path) -> None:
    path = tmp_path / "new" / "my.params"
    done = flightstack_command("--check", "--params", path)
    assert done.returncode == 0
    sentence = f"{path}: no such file, starting with the defaults; it will keep changes"
    assert done.stderr == f"flightstack: warning: {sentence}\n"
    assert not path.exists()  # a check changes nothing
    begin_param_file(path, 3)
    assert read_param_file(path) == []
    assert flightstack_command("--check", "--params", path).stderr == ""


def test_a_file_that_cannot_be_begun_ends_the_start(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "my.params"
    with pytest.raises(ConfigError, match=r"my\.params: cannot be written: (Not a directory|File exists)"):
        begin_param_file(path, 1)
