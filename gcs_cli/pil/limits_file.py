"""The file of ``--limits``: limits of signals in place of the built-in ones.

A table for each comparison (``flight``, ``sensed``, ``replay``, ``stages``), in it one for each signal, with the keys
``ulp``, ``rms_ulp`` and ``slope_ppm``. A value that the file does not give stays as it is.
"""

from __future__ import annotations

from pathlib import Path

from flightstack.params.toml_file import Table, read_toml
from gcs_cli.pil.signals import BY_NAME
from gcs_cli.pil.verdict import DEFAULT_LIMITS, Limits, LimitSet

_LARGEST = 1e12


def read_limits(path: Path | None) -> LimitSet:
    """Return the limits with those of the file; raise ConfigError for an unknown key or a value out of range."""
    if path is None:
        return DEFAULT_LIMITS
    file = read_toml(path)
    limits = LimitSet(
        *(_merged(file.optional_table(name), given) for name, given in DEFAULT_LIMITS._asdict().items())
    )
    file.finish()
    return limits


def _merged(table: Table, limits: Limits) -> Limits:
    kinds = {kind: dict(values) for kind, values in limits._asdict().items()}
    for signal in table.values():
        if signal not in BY_NAME:
            raise table.error(signal, f"is not a signal: use one of {', '.join(BY_NAME)}")
        of_signal = table.table(signal)
        for kind, values in kinds.items():
            if of_signal.has(kind):
                values[signal] = of_signal.number(kind, 0.0, _LARGEST)
        of_signal.finish()
    return Limits(**kinds)
