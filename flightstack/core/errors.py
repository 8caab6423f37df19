"""Errors whose text is one sentence for the user, and how to install optional packages."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping

# the packages of the extras by name: ``pip install 'flightstack[…]'`` needs a release on PyPI
INSTALL_MULTIBODY = "pip install mujoco pillow imageio-ffmpeg"
INSTALL_FIRMWARE = "pip install ziglang unicorn pyelftools"


_LARGEST_WHOLE = 1e15
"""Whole numbers from here on have an exponent in texts."""
_PREDICATES = frozenset({"is", "has", "does", "must", "needs", "cannot"})


def clause(subject: str, problem: str) -> str:
    """Return the problem of a value as one clause: a predicate follows its subject, a sentence follows a colon."""
    if not subject:
        return problem
    return f"{subject} {problem}" if problem.partition(" ")[0] in _PREDICATES else f"{subject}: {problem}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence about an unknown name, with the known one that is most like it, or nothing.

    >>> did_you_mean("squar", ["hop", "square"]), did_you_mean("circle", ["hop", "square"])
    ('; did you mean square?', '')
    """
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""


def plain(number: float) -> str:
    """Return a number with six digits, a whole one without an exponent.

    >>> plain(1e6), plain(0.1), plain(1e-6)
    ('1000000', '0.1', '1e-06')
    """
    is_whole = abs(number) < _LARGEST_WHOLE and number == int(number)
    return f"{number:.0f}" if is_whole else f"{number:g}"


class ConfigError(Exception):
    """Invalid option, with its value as ``key``, or configuration file."""

    def __init__(self, file: object, key: str, problem: str) -> None:
        if str(file).startswith("--"):
            super().__init__(f"{file}: {clause(key, problem)}" if key else clause(str(file), problem))
        else:
            super().__init__(f"{file}: {key}: {problem}" if key else f"{file}: {problem}")
        self._parts = (str(file), key, problem)

    def as_keyword(self, keys: Mapping[str, str]) -> ConfigError:
        """Return the error of an option that a keyword argument gives: ``--inner-hz`` is ``inner_hz``.

        ``keys``: keywords of options with another name. Other errors stay.
        """
        option, value, problem = self._parts
        if not option.startswith("--"):
            return self
        return ConfigError(_key(option, keys), "", clause(value, problem))

    def within(self, file: object, keys: Mapping[str, str]) -> ConfigError:
        """Return the error of an option that ``file`` gives: ``--inner-hz`` is its key ``inner_hz``.

        ``keys``: keys of options with another name.
        """
        option, value, problem = self._parts
        if not option.startswith("--"):
            return ConfigError(file, "", str(self))
        return ConfigError(file, _key(option, keys), clause(value, problem))

    def __reduce__(self) -> tuple[type[ConfigError], tuple[str, str, str]]:
        """Support pickling: the default passes the text alone to a constructor with three arguments."""
        return type(self), self._parts


class WriteError(ConfigError):
    """A file that was not written, although its name may be right: the exit code is 1."""


def _key(option: str, keys: Mapping[str, str]) -> str:
    return keys.get(option, option.removeprefix("--").replace("-", "_"))


class TargetError(RuntimeError):
    """The loops on the target cannot continue."""


class WrongFirmwareError(TargetError):
    """The target answers but runs incompatible firmware."""
