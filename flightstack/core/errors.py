"""Errors whose text is one sentence for the user, and how to install optional packages."""

from __future__ import annotations

INSTALL_MULTIBODY = "pip install mujoco pillow imageio-ffmpeg"
INSTALL_FIRMWARE = "pip install ziglang unicorn"


class ConfigError(Exception):
    """A bad configuration file; its text is one sentence fit for the user."""

    def __init__(self, file: object, key: str, problem: str) -> None:
        where = f"{file}: {key}: " if key else f"{file}: "
        super().__init__(where + problem)
        self._parts = (str(file), key, problem)

    def __reduce__(self) -> tuple[type[ConfigError], tuple[str, str, str]]:
        """Travel between processes: an exception is else made anew from its text alone, and this one takes three."""
        return type(self), self._parts


class TargetError(RuntimeError):
    """The target cannot be flown any further; the text is one sentence for the user."""


class WrongFirmwareError(TargetError):
    """The target answers, but it cannot fly what it is asked to."""
