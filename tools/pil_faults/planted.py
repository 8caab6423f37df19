"""Build the C loops with a planted fault, replay on them, and measure how far each signal is beyond its limit."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from flightstack.control.controller_loading import load_controller
from flightstack.firmware.c_loops import HostLoops, LoopsSetup
from flightstack.firmware.sources import firmware_root
from flightstack.firmware.toolchain.build import EXACT, host_compiler
from flightstack.params.gains_file import DEFAULT_GAINS, open_gains
from flightstack.params.vehicle import load_vehicle
from gcs_cli.pil.compare import compared
from gcs_cli.pil.excitation import excitation
from gcs_cli.pil.replay import Recording, as_flight, replayed
from gcs_cli.pil.result import pair_name
from gcs_cli.pil.stagewise import STAGEWISE, expected_outputs
from gcs_cli.pil.verdict import STAGE_LIMITS, Check, difference_checks
from tools.pil_faults.faults import BACKSTEPPING, PID, Fault, scaled, structural

VEHICLES = {PID: "paper_quad", BACKSTEPPING: "x_quad"}
"""Vehicle of each controller."""
_MORE_PITCH_INERTIA = 1.25
"""Factor that makes the inertias of roll and pitch differ, so that no coupling term is zero."""
TILT_DEG, INNER_HZ, OUTER_HZ = 35.0, 500.0, 100.0


class PlantedCore:
    """The C core in a folder, compiled file by file, so that a fault compiles one file anew."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._count = folder, 0
        self._core = folder / "core"
        shutil.copytree(firmware_root() / "core", self._core)
        port = firmware_root() / "ports" / "host"
        self._flags = [*host_compiler().command, *EXACT, "-O1", "-fPIC", f"-I{self._core}", f"-I{port}"]
        sources = [*sorted(self._core.glob("*.c")), port / "fs_sil.c"]
        self._objects = {source.name: self._compiled(source) for source in sources}

    def library(self, fault: Fault | None = None) -> Path:
        """Return the library of the loops with the fault in its source; without one as it is."""
        objects = dict(self._objects)
        if fault is not None and fault.file:
            source = self._core / fault.file
            text = source.read_text()
            try:
                source.write_text(text.replace(fault.right, fault.wrong))
                objects[fault.file] = self._compiled(source)
            finally:
                source.write_text(text)
        library = self._next(".so")
        self._run("-shared", *map(str, objects.values()), "-lm", "-o", str(library))
        return library

    def _compiled(self, source: Path) -> Path:
        made = self._next(".o")
        self._run("-c", str(source), "-o", str(made))
        return made

    def _next(self, ending: str) -> Path:
        self._count += 1
        return self._folder / f"{self._count}{ending}"

    def _run(self, *arguments: str) -> None:
        subprocess.run([*self._flags, *arguments], check=True, capture_output=True, text=True)


class Finding(NamedTuple):
    """Result of a replay on a faulty target: the checks that failed, furthest beyond their limits first."""

    fault: Fault
    failed: tuple[Check, ...]

    @property
    def excess(self) -> float:
        """Largest ratio of a measured value to its limit; infinite if no difference is allowed."""
        return max((ratio(check) for check in self.failed), default=0.0)


def ratio(check: Check) -> float:
    """Return the measured value over the limit."""
    return check.measured / check.limit if check.limit else math.inf


def setup_of(controller: str) -> LoopsSetup:
    """Return the configuration that a controller is replayed in."""
    vehicle = load_vehicle(VEHICLES[controller])
    roll, pitch, yaw = vehicle.inertia_kg_m2
    return LoopsSetup(
        replace(vehicle, inertia_kg_m2=(roll, _MORE_PITCH_INERTIA * pitch, yaw)),
        load_controller(controller),
        open_gains(DEFAULT_GAINS),
        math.radians(TILT_DEG),
        INNER_HZ,
        OUTER_HZ,
        round(INNER_HZ / OUTER_HZ),
    )


def faults() -> list[Fault]:
    """Return all faults."""
    numbers = {name: setup_of(name).numbers() for name in (PID, BACKSTEPPING)}
    return [*scaled(numbers), *structural()]


def checks_of(
    library: Path, setup: LoopsSetup, record: Recording, fault: Fault | None = None
) -> Iterator[Check]:
    """Replay ``record`` on a library with the fault and yield the checks stage by stage."""
    numbers = setup.numbers()
    planted = {fault.name: numbers[fault.name] * fault.factor} if fault is not None and fault.name else {}
    loops = HostLoops(library, {**numbers, **planted})
    outputs = replayed(record, loops, numbers.__contains__, lambda done, total: None)
    expected = expected_outputs(record, outputs, setup, {})
    pair = pair_name(STAGEWISE, "target")
    differences = compared(pair, as_flight(record, expected, {}), as_flight(record, outputs, {}))
    yield from difference_checks(pair, differences, STAGE_LIMITS)


def findings(core: PlantedCore, planted: Iterable[Fault]) -> Iterator[Finding]:
    """Replay the excitation with each of the faults."""
    sound, setups = core.library(), {name: setup_of(name) for name in (PID, BACKSTEPPING)}
    records = {name: excitation(setup) for name, setup in setups.items()}
    for fault in planted:
        setup, record = setups[fault.controller], records[fault.controller]
        library = core.library(fault) if fault.file else sound
        checks = checks_of(library, setup, record, fault)
        failed = [check for check in checks if not check.passed]
        yield Finding(fault, tuple(sorted(failed, key=ratio, reverse=True)))
