"""The vehicle's motion in a log of any kind: attitude, local and geographic position, velocity, home. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.geometry_bulk import quaternions_from_euler
from gcs_cli.logs.recording import AnyArray, Recording

_E7, _MM = 1e-7, 1e-3
_SCALE_M = 1000.0


class Samples(NamedTuple):
    """Values over the log's time: ``time_us`` of shape (n,), ``values`` of shape (n, k)."""

    time_us: AnyArray
    values: FloatArray

    @property
    def is_empty(self) -> bool:
        """True without samples."""
        return not len(self.time_us)


class Source(NamedTuple):
    """Fields of a topic, with the factors to SI units and degrees."""

    topic: str
    fields: tuple[str, ...]
    factors: tuple[float, ...] = ()


def elements(name: str, count: int) -> tuple[str, ...]:
    """Return the names of an array's elements."""
    return tuple(f"{name}[{index}]" for index in range(count))


_XYZ, _V_XYZ = ("x", "y", "z"), ("vx", "vy", "vz")
ATTITUDE = (
    Source("vehicle_attitude", elements("q", 4)),
    Source("ATTITUDE_QUATERNION", ("q1", "q2", "q3", "q4")),
)
EULER = (Source("ATTITUDE", ("roll", "pitch", "yaw")),)
RATES = (
    Source("vehicle_angular_velocity", elements("xyz", 3)),
    Source("vehicle_attitude", ("rollspeed", "pitchspeed", "yawspeed")),
    Source("ATTITUDE", ("rollspeed", "pitchspeed", "yawspeed")),
    Source("ATTITUDE_QUATERNION", ("rollspeed", "pitchspeed", "yawspeed")),
)
POSITION = (Source("vehicle_local_position", _XYZ), Source("LOCAL_POSITION_NED", _XYZ))
VELOCITY = (Source("vehicle_local_position", _V_XYZ), Source("LOCAL_POSITION_NED", _V_XYZ))
GEODETIC = (
    Source("vehicle_global_position", ("lat", "lon", "alt")),
    Source("GLOBAL_POSITION_INT", ("lat", "lon", "alt"), (_E7, _E7, _MM)),
)
SATELLITE = (
    Source("vehicle_gps_position", ("latitude_deg", "longitude_deg", "altitude_msl_m")),
    Source("vehicle_gps_position", ("lat", "lon", "alt"), (_E7, _E7, _MM)),
    Source("GPS_RAW_INT", ("lat", "lon", "alt"), (_E7, _E7, _MM)),
)
HOME = (
    Source("home_position", ("lat", "lon", "alt")),
    Source("HOME_POSITION", ("latitude", "longitude", "altitude"), (_E7, _E7, _MM)),
)
ORIGIN = (
    Source("vehicle_local_position", ("ref_lat", "ref_lon", "ref_alt")),
    Source("GPS_GLOBAL_ORIGIN", ("latitude", "longitude", "altitude"), (_E7, _E7, _MM)),
)


def samples(recording: Recording, sources: Sequence[Source], width: int, *, finite: bool = True) -> Samples:
    """Return the first source that the log has, with ``width`` columns.

    With ``finite``, rows that hold a NaN or an infinity are left out.
    """
    for source in sources:
        topic = recording.topic(source.topic)
        columns = None if topic is None else topic.columns(list(source.fields))
        if topic is not None and columns is not None:
            good = np.isfinite(columns).all(axis=1) | (not finite)
            factors = np.array(source.factors or (1.0,) * width)
            return Samples(topic.time_us[good], columns[good] * factors)
    return Samples(np.zeros(0, dtype=np.int64), np.zeros((0, width)))


@dataclass(frozen=True)
class Motion:
    """Attitude as quaternions FRD to NED, scalar first; positions and velocities NED [m, m/s] from the origin."""

    attitude: Samples
    rates: Samples
    """Body rates FRD [rad/s]."""
    position: Samples
    velocity: Samples
    geodetic: Samples
    """Latitude, longitude [deg] and altitude above mean sea level [m]."""
    home: GeoPoint | None
    origin: GeoPoint | None


def motion_of(recording: Recording) -> Motion:
    """Return the motion in the log; what it lacks is empty."""
    attitude = samples(recording, ATTITUDE, 4)
    if attitude.is_empty:
        euler = samples(recording, EULER, 3)
        attitude = Samples(euler.time_us, quaternions_from_euler(euler.values))
    position = samples(recording, POSITION, 3)
    home, origin = _point(samples(recording, HOME, 3)), _point(samples(recording, ORIGIN, 3))
    geodetic = samples(recording, GEODETIC, 3)
    if geodetic.is_empty and origin is not None:
        geodetic = Samples(position.time_us, _to_geo(origin, position.values))
    if geodetic.is_empty:
        geodetic = samples(recording, SATELLITE, 3)
    return Motion(
        attitude=attitude,
        rates=samples(recording, RATES, 3),
        position=position,
        velocity=samples(recording, VELOCITY, 3),
        geodetic=geodetic,
        home=home,
        origin=origin,
    )


def _point(found: Samples) -> GeoPoint | None:
    """Return the last sample that is a place."""
    known = found.values[(found.values[:, :2] != 0.0).any(axis=1)] if len(found.values) else found.values
    return GeoPoint(*map(float, known[-1])) if len(known) else None


def _to_geo(origin: GeoPoint, ned_m: FloatArray) -> FloatArray:
    """Return NED positions (n, 3) as latitude, longitude, altitude (n, 3), on the flat earth of ``LocalFrame``."""
    frame = LocalFrame(origin)
    place = np.array([*origin])
    corner = np.array([*frame.to_geo(Vector3(_SCALE_M, _SCALE_M, _SCALE_M))])
    geodetic: FloatArray = place + ned_m * (corner - place) / _SCALE_M
    return geodetic


def latest(found: Samples, time_us: AnyArray) -> FloatArray:
    """Return the newest sample at each time, the first one before it; (n, k), NaN without samples."""
    if found.is_empty:
        return np.full((len(time_us), found.values.shape[1]), np.nan)
    index = np.searchsorted(found.time_us, time_us, side="right") - 1
    return found.values[np.maximum(index, 0)]
