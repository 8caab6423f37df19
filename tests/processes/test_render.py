"""``sim-bridge render`` and ``gcs log draw`` as processes: picture files and error messages."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from unittest.mock import MagicMock

import imageio_ffmpeg
import pytest
from PIL import Image

from flightstack.core.errors import INSTALL_MULTIBODY
from flightstack.flight_log.poses_file import write_poses
from flightstack.params.vehicle import load_vehicle
from flightstack.simulator_link.hot_frames import ARMED_FLAG, LOCKSTEP_FLAG, ActuatorsFrame
from sim_bridge.errors import UsageProblemError
from sim_bridge.render.live_view import READY, SNAPSHOT, LiveView
from sim_bridge.render.offscreen import choose_backend
from sim_bridge.render.viewer import show
from sim_bridge.simulator import Simulator
from tests.support.commands import gcs, sim_bridge_command
from tests.support.process import Process
from tests.support.sample_poses import sample_poses
from tests.support.synthetic_flight import synthetic_flight_bytes
from tests.support.tools import NIGHTLY, missing

SMALL = ("--size", "96x54")


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    try:
        choose_backend()
    except UsageProblemError as error:
        missing(str(error))
    path = tmp_path_factory.mktemp("poses") / "poses.npz"
    write_poses(path, sample_poses(2.0))
    return path


def render(*arguments: object) -> subprocess.CompletedProcess[str]:
    program = [sys.executable, "-m", "sim_bridge", "render", *map(str, arguments)]
    return subprocess.run(program, capture_output=True, text=True, check=False)


def frames_of(path: Path) -> tuple[int, tuple[int, int]]:
    if path.suffix == ".gif":
        with Image.open(path) as image:
            return image.n_frames, image.size
    program = [
        imageio_ffmpeg.get_ffmpeg_exe(),
        "-v",
        "error",
        "-i",
        str(path),
        "-f",
        "image2pipe",
        "-c:v",
        "ppm",
        "-",
    ]
    pictures = subprocess.run(program, capture_output=True, check=True).stdout
    heads = re.findall(rb"P6\n(\d+) (\d+)\n255\n", pictures)
    return len(heads), (int(heads[0][0]), int(heads[0][1]))


def test_pictures_sheet_and_films_have_the_requested_size(poses: Path, tmp_path: Path) -> None:
    gif, mp4 = tmp_path / "f.gif", tmp_path / "f.mp4"
    done = render(
        poses, *SMALL, "--png", tmp_path / "p.png", "--at", "0.5,1.5", "--sheet", tmp_path / "s.png",
        "--video", gif, "--fps", "10", "--from", "1", "--to", "1.5", "--camera", "side",
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == [str(tmp_path / name) for name in ("p-1.png", "p-2.png", "s.png", "f.gif")]
    with Image.open(tmp_path / "p-2.png") as picture, Image.open(tmp_path / "s.png") as whole:
        assert picture.size == (96, 54)
        assert whole.size == (2 * 96 + 6, 54)
    assert frames_of(gif) == (5, (96, 54))
    done = sim_bridge_command(
        "render", poses, *SMALL, "--video", mp4, "--fps", "10", "--speed", "4", "--camera", "fixed"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert frames_of(mp4) == (5, (96, 54))
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "f.gif",
        "f.mp4",
        "p-1.png",
        "p-2.png",
        "s.png",
    ]


def test_a_log_is_replayed_from_end_to_end(
    poses: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The synthetic flight, through ``gcs log draw``, which takes the vehicle from the log."""
    (tmp_path / "flight.ulg").write_bytes(synthetic_flight_bytes(inner_ms=20, outer_ms=20, seconds=4.0))
    arguments = ("log", "draw", tmp_path, *SMALL, "--fps", "5", "--speed", "4", "--no-words")
    done = gcs(*arguments)
    assert (done.returncode, done.stderr, capfd.readouterr().err) == (0, "", "")
    assert frames_of(tmp_path / "replay.mp4") == (5, (96, 54))
    done = gcs(*arguments, "--camera", "nose")
    assert done.returncode == 2
    assert (
        done.stderr + capfd.readouterr().err
        == "gcs: --camera: 'nose' is not one of chase, fixed, top, side, whole\n"
    )


def test_damaged_log_is_drawn_up_to_the_damage_with_a_warning(
    poses: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    log = synthetic_flight_bytes(inner_ms=20, outer_ms=20, seconds=4.0)
    (tmp_path / "flight.ulg").write_bytes(log[: len(log) * 3 // 4])
    done = gcs("log", "draw", tmp_path, "--png", tmp_path / "p.png", *SMALL)
    assert done.returncode == 0
    said = re.fullmatch(
        r"gcs: warning: the log is damaged; drawn up to ([0-9.]+) s\n", done.stderr + capfd.readouterr().err
    )
    assert said is not None, done.stderr
    assert 0.5 < float(said[1]) < 4.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "nothing to do: give --png, --sheet, --video or --view"),
        (["--png", "p.jpg"], "--png p.jpg: the name must end in .png"),
        (["--video", "f.avi"], "--video f.avi: the name must end in .mp4 or .gif"),
        (["--png", "no/where/p.png"], "--png no/where/p.png: there is no directory no/where"),
        (["--png", "p.png", "--camera", "nose"], "--camera: 'nose' is not one of chase, fixed, top, side, whole"),
        (["--png", "p.png", "--size", "big"], "--size: 'big' is not WIDTHxHEIGHT in pixels, such as 1280x720"),
        (["--png", "p.png", "--size", "8x9"], "--size: 8 is outside the allowed range 16 to 4096"),
        (["--video", "f.mp4", "--size", "97x54"], "--size: an mp4 needs even numbers, not 97x54"),
        (["--video", "f.mp4", "--fps", "0"], "--fps: 0 is outside the allowed range 0.1 to 240"),
        (["--video", "f.mp4", "--speed", "nan"], "--speed: nan is outside the allowed range 0.001 to 1000"),
        (["--png", ""], "--png: the file name is missing; it must end in .png"),
        (["--png", "p.png", "--at", "1,x"], "--at: '1,x' is not a list of times in seconds, separated by commas\n"),
        (["--png", "p.png", "--at", "1," * 1000 + "1"], "--at: 1001 times are more than the allowed 1000"),
        (["--video", "f.mp4", "--at", "1"], "--at is for --png and --sheet; --from and --to select a part of a film"),
        (["--png", "p.png", "--from", "1"], "--from is for --video, --sheet and --view; --at selects"),
        (["--sheet", "s.png", "--at", "1", "--to", "1"], "--to is for --video, --sheet and --view"),
        (["--png", "p.png", "--fps", "5"], "--fps is for --video"),
        (["--png", "p.png", "--speed", "5"], "--speed is for --video and --view"),
        (["--png", "p.png", "--at", "99"], "--at: 99 s is outside the flight, 0 to 2 s"),
        (["--video", "f.mp4", "--from", "-1"], "--from: -1 s is outside the flight, 0 to 2 s"),
        (["--video", "f.mp4", "--from", "1.5", "--to", "1"], "--from 1.5, --to 1: the film would end before it begins"),
        (["--video", "f.mp4", "--speed", "0.001", "--fps", "240"], "the film would have 480000 frames"),
        (["--png", "p.png", "--vehicle", "boat"], "boat: is neither a file nor a built-in vehicle"),
    ],
)  # fmt: skip
def test_bad_arguments_are_one_sentence(
    poses: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    done = sim_bridge_command("render", poses, *arguments)
    assert done.returncode == 2
    assert f"sim-bridge: {said}" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [([], "sim-bridge: render needs MuJoCo"), (["--caller", "gcs log draw"], "gcs: log draw needs MuJoCo")],
)
def test_error_messages_name_the_calling_command(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    said: str,
) -> None:
    write_poses(tmp_path / "poses.npz", sample_poses(1.0))
    monkeypatch.setattr("sim_bridge.arguments.find_spec", lambda _name: None)
    done = sim_bridge_command("render", tmp_path / "poses.npz", "--png", tmp_path / "p.png", *arguments)
    assert (done.returncode, done.stderr) == (2, f"{said}: {INSTALL_MULTIBODY}\n")


def test_without_a_renderer_nothing_is_written(poses: Path, tmp_path: Path) -> None:
    program = [sys.executable, "-m", "sim_bridge", "render", str(poses), "--png", str(tmp_path / "p.png")]
    environment = {**os.environ, "MUJOCO_GL": "disable"}
    done = subprocess.run(program, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 2
    assert done.stderr == "sim-bridge: no off-screen renderer: MUJOCO_GL=disable turns it off; unset it\n"
    assert not list(tmp_path.iterdir())


def test_an_interrupted_film_leaves_the_old_one(poses: Path, tmp_path: Path) -> None:
    film = tmp_path / "f.mp4"
    film.write_bytes(b"the old one")
    arguments = [poses, *SMALL, "--video", film, "--overwrite", "--fps", "240", "--speed", "0.01"]
    process = Process("sim_bridge", "render", *map(str, arguments))
    begun = threading.Event()
    while not begun.wait(0.02):  # the unfinished film has a temporary name
        if len(list(tmp_path.iterdir())) > 1:
            begun.set()
        assert process.is_running, process.output
    process.interrupt()
    assert process.end() == 130
    assert process.lines[1:] == ["sim-bridge: interrupted: the unfinished file is removed"]
    assert [path.name for path in tmp_path.iterdir()] == ["f.mp4"]
    assert film.read_bytes() == b"the old one"


# ------------------------------------------------------------------ live

_WINDOW = """
import sys
sys.stdout.write("ready\\n"); sys.stdout.flush()
data = sys.stdin.buffer.read()
open(sys.argv[1], "wb").write(data)
"""


def climb(simulator: Simulator) -> list[bytes]:
    """Fly up for three seconds; return all states sent. It would reach the ground one second later."""
    actuators, frames = ActuatorsFrame(), []
    actuators.set_rotor_count(4)
    actuators.rotor_speed_rad_s[:4] = (240.0, 240.5, 241.0, 240.2)
    for _ in range(1500):
        frames.append(bytes(simulator.state_frame()))
        actuators.seal(simulator.time_us, ARMED_FLAG | LOCKSTEP_FLAG)
        simulator.apply(actuators)
    return frames


def test_live_window_receives_states_and_does_not_change_the_flight(tmp_path: Path) -> None:
    """A program in place of the window records its input; the states sent are the same without it."""
    alone = climb(Simulator(load_vehicle("paper_quad")))
    watched = Simulator(load_vehicle("paper_quad"))
    view = LiveView(str(tmp_path / "heard"), (sys.executable, "-c", _WINDOW))
    with view.watching(watched):
        assert climb(watched) == alone
    heard = (tmp_path / "heard").read_bytes()
    assert len(set(alone)) == 1500
    assert heard
    assert len(heard) % SNAPSHOT.size == 0
    for time_s, north, east, down, *_ in SNAPSHOT.iter_unpack(heard):
        assert 0.0 <= time_s <= 3.0
        assert down <= 0.001
        assert abs(north) + abs(east) < 50.0


def test_closed_window_does_not_stop_the_simulator(tmp_path: Path) -> None:
    view = LiveView("", (sys.executable, "-c", "print('ready', flush=True)"))
    simulator = Simulator(load_vehicle("paper_quad"))
    with view.watching(simulator):
        while view.write(bytes(SNAPSHOT.size)):  # until the program has ended
            pass
        assert len(climb(simulator)) == 1500


def test_window_that_cannot_open_is_an_error_with_its_reason() -> None:
    program = (sys.executable, "-c", "import sys; print('--view: no display', file=sys.stderr); sys.exit(2)")
    with pytest.raises(UsageProblemError, match=r"^--view: no display$"):
        LiveView("paper_quad", program)
    with pytest.raises(UsageProblemError, match=r"^--view: the window cannot be opened: it ended at once$"):
        LiveView("paper_quad", (sys.executable, "-c", ""))


def test_live_view_without_a_display_ends_before_anything_starts() -> None:
    environment = {
        name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")
    }
    program = [sys.executable, "-m", "sim_bridge", "--view", "--port", "0"]
    done = subprocess.run(program, capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("sim-bridge: --view: no display")


def test_the_window_waits_for_its_drawing_thread_however_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drawing thread that outlives Python crashes in the driver: the wait has no timeout."""
    drawn, waits = threading.Event(), list[float | None]()

    def launch(*_arguments: object, **_options: object) -> MagicMock:
        thread = threading.Thread(target=drawn.wait, daemon=True)

        def join(timeout: float | None = None) -> None:
            waits.append(timeout)
            drawn.set()

        monkeypatch.setattr(thread, "join", join)
        thread.start()
        return MagicMock()

    monkeypatch.setattr("mujoco.viewer.launch_passive", launch)
    show(MagicMock(span_m=1.0), [], MagicMock())
    assert waits == [None]


@pytest.mark.skipif(not NIGHTLY, reason="a renderer in software: set NIGHTLY=1")
def test_a_window_shows_a_flight_on_a_virtual_display(poses: Path) -> None:
    """The window opens on Xvfb, reads snapshots and closes in order."""
    if shutil.which("Xvfb") is None:
        missing("Xvfb is not installed: apt install xvfb")
    read, write = os.pipe()
    with subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "320x240x24"], pass_fds=[write], stderr=subprocess.DEVNULL
    ) as server:  # fmt: skip
        os.close(write)
        try:
            with os.fdopen(read) as told:
                display = f":{int(told.readline())}"
            program = [sys.executable, "-m", "sim_bridge.render.live_window", "paper_quad"]
            with subprocess.Popen(
                program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                env={**os.environ, "DISPLAY": display},
            ) as window:  # fmt: skip
                assert window.stdout is not None
                ready = window.stdout.readline()
                snapshot = SNAPSHOT.pack(1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 6, *[200.0] * 8)
                _, said = window.communicate(20 * snapshot)
            assert (ready, window.returncode) == (READY, 0), said
        finally:
            server.terminate()
