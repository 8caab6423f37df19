"""Firmware with a user's attitude controller: a copy of the sources with the controller's law generated as C.

The copy is a whole ``firmware`` folder, which also compiles for a board. Copies are kept in
``~/.cache/flightstack/firmware/laws``, by their content.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flightstack.control.attitude_controller import AttitudeController
from flightstack.core.errors import ConfigError
from flightstack.firmware.build import cache_root
from flightstack.firmware.numbers import CONTROLLERS, law_name, with_built_in
from flightstack.firmware.sources import firmware_root, source_hash, using_firmware

_LAW_MATH = "fs_law_math.h"
_KEPT = 8


def generated_files(controller: AttitudeController) -> dict[str, str]:
    """Return the files of ``core`` with this controller's law; raise ConfigError if it is outside the subset."""
    from flightstack.firmware.generator.core_files import core_files  # noqa: PLC0415  # a tenth of a second
    from flightstack.firmware.generator.subset import OutsideSubsetError  # noqa: PLC0415

    try:
        texts = core_files(with_built_in(controller))
    except (OutsideSubsetError, ValueError) as error:
        raise ConfigError("--controller", controller.name, f"has no C: {error}") from None
    if any(_LAW_MATH in text for text in texts.values()):
        texts[_LAW_MATH] = (firmware_root() / "laws" / _LAW_MATH).read_text(encoding="ascii")
    return texts


def write_tree(controller: AttitudeController, folder: Path) -> Path:
    """Write the whole firmware with this controller to ``folder``; return it. Raise ConfigError, OSError."""
    texts = generated_files(controller)
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc", "build")
    shutil.copytree(firmware_root(), folder, ignore=ignored, dirs_exist_ok=True)
    for name, text in texts.items():
        (folder / "core" / name).write_text(text, encoding="ascii")
    return folder


def law_tree(controller: AttitudeController) -> Path:
    """Return the firmware that flies a controller: that of the installation for a built-in one.

    Raise ConfigError if the controller's law is outside the generator's subset.
    """
    if any(controller.name == known.name for known in CONTROLLERS):
        return firmware_root()
    digest = hashlib.sha256(source_hash())
    for name, text in sorted(generated_files(controller).items()):
        digest.update(f"{name}\0{text}\0".encode())
    base = cache_root() / "laws"
    place = base / f"{law_name(controller)}-{digest.hexdigest()[:16]}"
    if place.is_dir():
        return place
    base.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=base, prefix=".") as fresh:
        made = write_tree(controller, Path(fresh) / "firmware")
        if not place.is_dir():
            made.rename(place)
    trees = [path for path in base.iterdir() if path.is_dir() and not path.name.startswith(".")]
    for old in sorted(trees, key=lambda path: path.stat().st_mtime, reverse=True)[_KEPT:]:
        shutil.rmtree(old, ignore_errors=True)
    return place


@contextmanager
def firmware_for(controller: AttitudeController) -> Iterator[Path]:
    """Build and identify firmware of this controller's sources within the context; raise ConfigError."""
    tree = law_tree(controller)
    with using_firmware(tree):
        yield tree
