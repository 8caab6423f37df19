"""Firmware with a user's controller: a copy of the sources with the controller's laws generated as C.

The copy is a whole ``firmware`` folder, which also compiles for a board. Copies are kept in
``~/.cache/flightstack/firmware/laws``, by their content.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flightstack.control.controller import AnyController, Controller, controller_of, laws_with
from flightstack.control.controller_loading import fields_of, load_controller
from flightstack.control.loop_parameters import LawValues, loop_numbers, own_values
from flightstack.core.errors import ConfigError
from flightstack.firmware.c_loops import LoopsSetup
from flightstack.firmware.generator.subset import OutsideSubsetError
from flightstack.firmware.generator.text import snake_case
from flightstack.firmware.sources import firmware_root, source_hash, using_firmware
from flightstack.firmware.toolchain.build import COMPILE_LIMIT_S, EXACT, BuildError, cache_root, host_compiler

_LAW_MATH = "fs_law_math.h"
_GENERAL = frozenset(
    ("fs_attitude_reference.c", "fs_position_pid.c", "fs_attitude_pid.c", "fs_attitude_backstepping.c")
)
"""Generated files that are the same for every controller."""
_SHARED = ("fs_geometry.h", "fs_portable_math.h")
"""Generated headers of functions that laws and estimator share: the estimator has those that no law uses."""
KEPT_TREES = 8
"""Number of generated firmware trees that are kept."""
WARNINGS = (
    "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wconversion", "-Wdouble-promotion", "-Wshadow",
    "-Wstrict-prototypes", "-Wmissing-prototypes", "-Wundef", "-Wvla", "-Wcast-qual", "-Wpointer-arith",
)  # fmt: skip


def controller_named(name: str) -> Controller:
    """Return the installed controller ``name``; raise ConfigError if it is missing or broken."""
    return load_controller(name)


def is_built_in(controller: AnyController) -> bool:
    """Return True if the installation's firmware has all laws of the controller."""
    return not controller_of(controller).own_laws


def own_params(setup: LoopsSetup) -> dict[str, str]:
    """Return the entry ``law_params`` of a log: parameters of laws that are not built-in; empty without such a law."""
    numbers = loop_numbers(setup.vehicle, setup.controller, setup.gains, setup.max_tilt_rad, setup.given)
    own = own_values(numbers, setup.controller)
    return {"law_params": json.dumps(own)} if own else {}


def logged_params(controller: Controller, text: str, log: Path) -> LawValues:
    """Return the parameters of the controller's own laws from ``law_params`` of a log; raise ConfigError."""
    values: dict[str, dict[str, float]] = json.loads(text)
    fields = {role: fields_of(law.params_type) for role, law in controller.own_laws.items()}
    if values and {role: tuple(known) for role, known in values.items()} != fields:
        problem = f"was flown by another version of the controller {controller.name}: install that one"
        raise ConfigError(log, "", problem)
    return values


def generated_files(controller: AnyController) -> dict[str, str]:
    """Return the files of ``core`` with this controller's laws; raise ConfigError if one is outside the subset.

    The estimator's files are among them if the laws use a function that was the estimator's alone.
    """
    from flightstack.firmware.generator.core_files import core_files
    from flightstack.firmware.generator.filter_files import filter_files

    laws, core = laws_with(controller), firmware_root() / "core"
    try:
        texts = core_files(laws)
        if any((core / name).read_text(encoding="ascii") != texts.get(name, "") for name in _SHARED):
            texts |= {f"estimation/{name}": text for name, text in filter_files(laws).items()}
    except (OutsideSubsetError, TypeError, ValueError) as error:
        raise ConfigError("--controller", controller.name, f"has no C: {error}") from None
    if any(_LAW_MATH in text for text in texts.values()):
        texts[_LAW_MATH] = (firmware_root() / "laws" / _LAW_MATH).read_text(encoding="ascii")
    return texts


def generated_names(controller: AnyController) -> set[str]:
    """Return the names of the files that the installation's firmware does not have."""
    core = firmware_root() / "core"
    return {name for name in generated_files(controller) if not (core / name).exists()}


def write_tree(controller: AnyController, folder: Path) -> Path:
    """Write the whole firmware with this controller to ``folder``; return it. Raise ConfigError, OSError.

    The generated files are compiled once, with all warnings as errors.
    """
    texts = generated_files(controller)
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc", "build")
    shutil.copytree(firmware_root(), folder, ignore=ignored, dirs_exist_ok=True)
    for name, text in texts.items():
        (folder / "core" / name).write_text(text, encoding="utf-8")
    by_hand = {path.name for law in controller_of(controller).own_laws.values() for path in law.sources}
    laws = sorted(
        name for name in texts.keys() - by_hand - _GENERAL if name.endswith(".c") and "/" not in name
    )
    _compile_strictly(controller, [folder / "core" / name for name in laws])
    return folder


def _compile_strictly(controller: AnyController, sources: list[Path]) -> None:
    """Raise ConfigError if a compiler of this machine has a warning for the generated files."""
    try:
        command = [*host_compiler().command, *EXACT, *WARNINGS, "-fsyntax-only", *map(str, sources)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=COMPILE_LIMIT_S)
    except (BuildError, OSError, subprocess.TimeoutExpired) as error:
        raise ConfigError("--controller", controller.name, f"its C cannot be compiled: {error}") from None
    if done.returncode != 0:
        said = next((line for line in done.stderr.splitlines() if "error" in line), "no message")
        raise ConfigError(
            "--controller", controller.name, f"its C does not compile without a warning: {said}"
        )


def law_tree(controller: AnyController) -> Path:
    """Return the firmware that flies a controller: that of the installation for a built-in one.

    Raise ConfigError if the controller's law is outside the generator's subset.
    """
    if is_built_in(controller):
        return firmware_root()
    digest = hashlib.sha256(source_hash())
    for name, text in sorted(generated_files(controller).items()):
        digest.update(f"{name}\0{text}\0".encode())
    base = _laws_folder()
    place = base / f"{snake_case(controller.name)}-{digest.hexdigest()[:16]}"
    if place.is_dir():
        os.utime(place)
        return place
    with tempfile.TemporaryDirectory(dir=base, prefix=".") as fresh:
        made = write_tree(controller, Path(fresh) / "firmware")
        try:
            made.rename(place)
        except OSError:
            if not place.is_dir():  # no other process has written it meanwhile
                raise
    os.utime(place)  # the copy has the time of its source
    trees = [path for path in base.iterdir() if path.is_dir() and not path.name.startswith(".")]
    for old in sorted(trees, key=lambda path: path.stat().st_mtime, reverse=True)[KEPT_TREES:]:
        shutil.rmtree(old, ignore_errors=True)
    return place


def _laws_folder() -> Path:
    """Return the folder of generated firmware; one of this process if the cache cannot be written."""
    base = cache_root() / "laws"
    try:
        base.mkdir(parents=True, exist_ok=True)
    except OSError:
        return Path(tempfile.mkdtemp(prefix="flightstack-laws-"))
    return base if os.access(base, os.W_OK) else Path(tempfile.mkdtemp(prefix="flightstack-laws-"))


@contextmanager
def firmware_for(controller: AnyController) -> Iterator[Path]:
    """Build and identify firmware of this controller's sources within the context; raise ConfigError."""
    tree = law_tree(controller)
    with using_firmware(tree):
        yield tree
