"""Vehicles with several inertial sensors."""

from __future__ import annotations

from pathlib import Path

from flightstack.params import vehicle

_X_QUAD = Path(vehicle.__file__).parent / "vehicles" / "x_quad.toml"


def x_quad_with_imus(folder: Path, count: int = 2) -> str:
    """Write the file of an x_quad with ``count`` inertial sensors; return its path."""
    path = folder / f"x_quad_{count}_imus.toml"
    path.write_text(f"{_X_QUAD.read_text()}\n[sensors.imu]\ncount = {count}\n")
    return str(path)
