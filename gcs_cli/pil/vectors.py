"""Test vectors: the inputs of the loops, and the outputs of a flight, as columns of a CSV, MATLAB or HDF5 file.

Numbers are float32, as on the line to a target; nine digits hold them to the last bit. The description (vehicle,
controller, rates, parameters) is one JSON object: the first line of a CSV file, after ``#``; the variable ``about`` of
a MATLAB file, the attribute ``about`` of an HDF5 file.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.atomic_file import write_bytes_atomically
from flightstack.core.contract import MAX_ROTORS, FloatArray, LoopFlags
from flightstack.core.errors import ConfigError, WriteError
from gcs_cli.errors import CliError, library
from gcs_cli.pil.flight_samples import FlightSamples, Samples, TimeArray
from gcs_cli.pil.replay import INPUT_SIZE, OUTPUT_SIZE, OUTPUTS, Recording, as_flight

FORMAT = "flightstack-vectors-1"
SUFFIXES = (".csv", ".mat", ".h5")
TABLE = "vectors"
"""Name of the table in a MATLAB file, and of the group in an HDF5 file."""


def _axes(name: str, unit: str, axes: str) -> list[str]:
    return [f"{name}_{axis}{unit}" for axis in axes]


def _state(prefix: str) -> list[str]:
    return [*_axes(f"{prefix}position", "_m", "ned"), *_axes(f"{prefix}velocity", "_m_s", "ned")]


_INPUTS = (
    *_state(""),
    *_axes("attitude", "", "wxyz"),
    *_axes("rate", "_rad_s", "xyz"),
    *_state("setpoint_"),
    *_axes("setpoint_acceleration", "_m_s2", "ned"),
    "setpoint_yaw_rad",
    "setpoint_yaw_rate_rad_s",
    *_axes("given_attitude", "", "wxyz"),
    "given_thrust_n",
)
_OUTPUTS = (
    *_axes("out_target", "", "wxyz"),
    "out_target_thrust_n",
    *_axes("out_reference", "", "wxyz"),
    *_axes("out_reference_rate", "_rad_s", "xyz"),
    *_axes("out_reference_acceleration", "_rad_s2", "xyz"),
    "out_thrust_n",
    *_axes("out_torque", "_n_m", "xyz"),
    "out_thrust_achieved_n",
    *_axes("out_torque_achieved", "_n_m", "xyz"),
    *(f"out_rotor_{rotor + 1}_rad_s" for rotor in range(MAX_ROTORS)),
    "out_status",
)
assert (len(_INPUTS), len(_OUTPUTS)) == (INPUT_SIZE, OUTPUT_SIZE)
_OUTER = LoopFlags.OUTER_DUE | LoopFlags.SET_TARGET


class Vectors(NamedTuple):
    """Inputs, and what they are to be replayed with."""

    record: Recording
    outputs: FloatArray | None
    """Outputs of the loops that flew, (n, 32); None if nothing flew."""
    info: Mapping[str, Any]
    """Vehicle, controller and rates, with the names of the log."""
    parameters: Mapping[str, float]

    def as_flight(self) -> FlightSamples:
        """Return the vectors in the form of a log; without outputs, it has no signals."""
        if self.outputs is None:
            none = Samples(np.zeros(0, np.int64), np.zeros((0, 1), np.float32))
            return FlightSamples({}, none, {}, self.info, self.parameters, ())
        return as_flight(self.record, self.outputs, self.info)._replace(parameters=self.parameters)


def vectors_of(flight: FlightSamples, record: Recording) -> Vectors:
    """Return the vectors of a log."""
    outputs = np.zeros((len(record.time_us), OUTPUT_SIZE))
    for name, columns in OUTPUTS.items():
        samples = flight.signals[name]
        held = np.searchsorted(samples.time_us, record.time_us, side="right") - 1
        values = samples.values[np.maximum(held, 0)]
        outputs[:, columns.start : columns.start + values.shape[1]] = values
    at = np.searchsorted(flight.status.time_us, record.time_us)
    outputs[:, -1] = flight.status.values[at, 0]
    info = {name: value for name, value in flight.info.items() if isinstance(value, str | int | float)}
    return Vectors(record, outputs, info, flight.parameters)


def write_vectors(path: Path, vectors: Vectors) -> None:
    """Write a file, its format by its suffix; raise ConfigError, CliError without the package of HDF5."""
    record = vectors.record
    columns: dict[str, Any] = {"time_us": record.time_us, "flags": record.flags}
    columns |= dict(zip(_INPUTS, record.inputs.astype(np.float32).T, strict=True))
    if vectors.outputs is not None:
        columns |= dict(zip(_OUTPUTS, vectors.outputs.astype(np.float32).T, strict=True))
    changes = [[step, name, value] for step, listed in record.changes.items() for name, value in listed]
    about = {
        "format": FORMAT,
        "info": dict(vectors.info),
        "parameters": dict(vectors.parameters),
        "changes": changes,
        "tells_targets": record.tells_targets,
    }
    write = _WRITERS[path.suffix.lower()]
    try:
        write_bytes_atomically(path, write(json.dumps(about, ensure_ascii=True), columns))
    except OSError as error:
        raise WriteError(path, "", f"cannot be written: {error.strerror}") from error


def _as_csv(about: str, columns: Mapping[str, Any]) -> bytes:
    text = io.StringIO()
    text.write(f"# {about}\n{','.join(columns)}\n")
    table = np.column_stack([column.astype(np.float64) for column in columns.values()])
    formats = ["%d", "%d", *["%.9g"] * (len(columns) - 2)]
    np.savetxt(text, table, formats, delimiter=",")
    return text.getvalue().encode("ascii")


def _as_mat(about: str, columns: Mapping[str, Any]) -> bytes:
    from scipy.io import savemat

    content = io.BytesIO()
    table = {name: column[:, None] for name, column in columns.items()}
    savemat(content, {"about": about, TABLE: table}, long_field_names=True, do_compression=True)
    return content.getvalue()


def _as_hdf5(about: str, columns: Mapping[str, Any]) -> bytes:
    content = io.BytesIO()
    with library("h5py").File(content, "w") as file:
        file.attrs["about"] = about
        group = file.create_group(TABLE)
        for name, column in columns.items():
            group.create_dataset(name, data=column, compression="gzip")
    return content.getvalue()


_WRITERS: Mapping[str, Callable[[str, Mapping[str, Any]], bytes]] = {
    ".csv": _as_csv,
    ".mat": _as_mat,
    ".h5": _as_hdf5,
}


def read_vectors(path: Path) -> Vectors:
    """Read a file, its format by its suffix; raise ConfigError, CliError without the package of HDF5."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(path, "", f"cannot be read: {error.strerror}") from error
    try:
        about, columns = _READERS.get(path.suffix.lower(), _from_csv)(content)
        return _vectors(json.loads(about), columns)
    except KeyError as error:
        raise ConfigError(path, "", f"is not a file of test vectors: it has no {error.args[0]}") from error
    except CliError:
        raise
    except Exception as error:  # SciPy and h5py raise what it meets in a damaged file
        raise ConfigError(path, "", f"is not a file of test vectors: {error}") from error


def _from_csv(content: bytes) -> tuple[str, dict[str, FloatArray]]:
    about, names, rest = content.decode("ascii").split("\n", 2)
    table = np.loadtxt(io.StringIO(rest), delimiter=",", ndmin=2)
    return about.removeprefix("#"), dict(zip(names.strip().split(","), table.T, strict=True))


def _from_mat(content: bytes) -> tuple[str, dict[str, FloatArray]]:
    from scipy.io import loadmat

    file = loadmat(io.BytesIO(content), simplify_cells=True)
    table = {name: np.atleast_1d(np.asarray(column, np.float64)) for name, column in file[TABLE].items()}
    return str(file["about"]), table


def _from_hdf5(content: bytes) -> tuple[str, dict[str, FloatArray]]:
    with library("h5py").File(io.BytesIO(content), "r") as file:
        table = {name: np.asarray(column, np.float64) for name, column in file[TABLE].items()}
        return str(file.attrs["about"]), table


_READERS = {".csv": _from_csv, ".mat": _from_mat, ".h5": _from_hdf5}


def _vectors(about: Mapping[str, Any], columns: Mapping[str, FloatArray]) -> Vectors:
    if about["format"] != FORMAT:
        raise ValueError(f"its format is {about['format']}, not {FORMAT}")
    flags = columns["flags"].astype(np.int64)
    times_us: TimeArray = columns["time_us"].astype(np.int64)
    if not len(times_us) or np.any(np.diff(times_us) <= 0):
        raise ValueError("its times do not rise")
    inputs = np.column_stack([columns[name] for name in _INPUTS])
    outputs = np.column_stack([columns[name] for name in _OUTPUTS]) if _OUTPUTS[0] in columns else None
    if not np.isfinite(inputs).all():
        raise ValueError("an input is not a finite number")
    changes: dict[int, tuple[tuple[str, float], ...]] = {}
    for step, name, value in about["changes"]:
        changes[int(step)] = (*changes.get(int(step), ()), (str(name), float(value)))
    record = Recording(
        times_us,
        inputs.astype(np.float32).astype(np.float64),
        flags,
        (flags & _OUTER) != 0,
        changes,
        bool(about["tells_targets"]),
    )
    parameters = {str(name): float(value) for name, value in about["parameters"].items()}
    return Vectors(record, outputs, dict(about["info"]), parameters)
