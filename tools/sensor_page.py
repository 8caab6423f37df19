"""The page of docs/reference with the numbers of the sensors, from their declarations."""

from __future__ import annotations

from flightstack.core.errors import plain
from flightstack.params.sensors import TABLES, Number, Value

_HEAD = """\
---
hide: [toc]
---

# Sensors

{note}

The simulator measures with the sensors of the vehicle file. The optional table `[sensors]` has the grade:
`consumer` (the default), `ideal` (the same rates, no errors) or `none`. A table for each sensor replaces single
numbers of the grade; `false` removes a sensor. Rangefinder and flow sensor exist only if the file names them.

```toml
[sensors]
grade = "consumer"
mag = false            # no magnetometer
flow = true            # a flow sensor with the numbers of the grade

[sensors.imu]
count = 2
position_frd_m = [0.03, 0.0, -0.02]
```

Every sensor has a random stream of its own, from the seed of the simulation: a sensor more or less changes no
other one, and the same seed gives the same bytes at any speed. Constant errors (bias, scale, misalignment,
iron) are drawn once for a seed. A value of a vector is one for all axes, unless a list is shown.
"""

_TITLES = {
    "imu": "Inertial sensor",
    "mag": "Magnetometer",
    "baro": "Barometer",
    "gnss": "GNSS receiver",
    "range": "Rangefinder",
    "flow": "Optical flow",
}

_TEXTS = {
    "imu": """\
Measures in each exchange: the mean of rates and specific force since the last one, from the change of attitude
and of the velocity of the mounting. Their sums are therefore those of the flight, whatever the step. The rotors
shake the sensor with U·Ω² at their own angles; U is the imbalance. Biases wander as Gauss-Markov processes, and
move with the temperature, which rises after switch-on as 1 − exp(−t / T). Equations:
`sim_bridge/sensors/imu.py`.
""",
    "mag": """\
The earth's field at home is that of the World Magnetic Model 2025 (pygeomag), at 2026.0. The output is (I +
S)·B + h + c·I with soft iron S, hard iron h and the current I of the battery.
""",
    "baro": """\
The pressure of the standard atmosphere (ISO 2533), with shares of the dynamic pressure ½ρv² and of the downwash
of the rotors near the ground, (T / A)·(R / 2z)².
""",
    "gnss": """\
Position and velocity at the origin of the vehicle. The receiver states the standard deviations of the model as
`eph` (both horizontal axes, √2·σ) and `epv`. Errors that last longer than a flight are left out: the position
is right in the mean.
""",
    "range": "Points along +z of the body. Out of range or beyond 60° of tilt it has no echo.\n",
    "flow": "Points along +z of the body; signs as in OPTICAL_FLOW_RAD.\n",
}

_TAIL = """
## How they are verified

`tests/unit/test_imu_model.py` integrates the ideal sensor over 10 s of tumbling flight with SciPy's rotations:
attitude within 10⁻¹² rad, velocity within 10⁻¹¹ m/s. Noise has the Allan variance of its density and the
wandering bias that of a Gauss-Markov process. `tests/unit/test_sensor_models.py` compares with NOAA's test
values of the World Magnetic Model, the table of ISO 2533, covariances and closed forms.
`tests/unit/test_sensor_faults.py` flies each fault of each sensor beside the same flight without it: the difference is
the fault, within the steps of the messages.
"""


def sensor_page(note: str) -> str:
    """Return the page."""
    parts = [_HEAD.format(note=note)]
    for name, items in TABLES.items():
        parts.append(f"\n## {_TITLES[name]}\n\n`[sensors.{name}]`. {_TEXTS[name]}\n")
        parts.append(
            "| key | unit | meaning | range | consumer | ideal | source of the number |\n"
            "|---|---|---|---|---|---|---|\n"
        )
        parts += [_row(item) for item in items]
    return "".join(parts) + _TAIL


def _row(item: Number) -> str:
    span = f"{plain(item.low)} to {plain(item.high)}"
    shown = f"{_text(item.consumer)} | {_text(item.ideal)}"
    return f"| `{item.key}` | {item.unit} | {item.meaning} | {span} | {shown} | {item.source} |\n"


def _text(value: Value) -> str:
    return (
        "[" + ", ".join(f"{part:g}" for part in value) + "]"
        if isinstance(value, tuple)
        else plain(float(f"{value:.4g}"))
    )
