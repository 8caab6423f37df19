"""Barometer: the static pressure of the standard atmosphere (ISO 2533), and what the port feels beside it.

    p(h) = 1013.25 hPa · (1 − 0.0065 h / 288.15)^5.25588            up to 11 km
    out  = p(h) + k_d · ½ρv² + k_g · (T / A) · (R / 2z)² + offset + drift + n

v is the airspeed, T / A the disc loading, z the height of the port above ground, at least half the radius R of a rotor:
the downwash stagnates under the vehicle, with the height law of the ground effect of the rotors.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import FloatArray, RecordArray
from flightstack.core.portable_math import exp, log
from flightstack.params.vehicle import Vehicle
from sim_bridge.plant.dimensions import foot_z_m, propeller_radius_m
from sim_bridge.sensors.layout import BARO, write_numbers
from sim_bridge.sensors.noise import NormalStream, gauss_markov, quantised, step_to, with_fault

SEA_LEVEL_HPA, SEA_LEVEL_K, LAPSE_K_M = 1013.25, 288.15, 0.0065
_EXPONENT = 9.80665 / (287.05287 * LAPSE_K_M)
_GAS_J_KG_K = 287.05287
_LEAST_RADII = 0.5
_PA_PER_HPA = 100.0


@compiled
def standard_pressure_hpa(altitude_m: float) -> float:
    """Return the pressure of the standard atmosphere."""
    pressure: float = SEA_LEVEL_HPA * exp(_EXPONENT * log(1.0 - LAPSE_K_M * altitude_m / SEA_LEVEL_K))
    return pressure


@compiled
def pressure_altitude_m(pressure_hpa: float) -> float:
    """Return the altitude of a pressure in the standard atmosphere."""
    share: float = exp(log(pressure_hpa / SEA_LEVEL_HPA) / _EXPONENT)
    return (1.0 - share) * SEA_LEVEL_K / LAPSE_K_M


@compiled
def measure_baro(
    baros: RecordArray,
    time_us: int,
    state: FloatArray,
    airspeed_m_s: float,
    rotor_speed: FloatArray,
    noise: FloatArray,
) -> None:
    """Write pressure, pressure altitude and temperature to ``out``; ``noise`` are two standard normal deviates."""
    baro = baros[0]
    decay, share = gauss_markov(step_to(baro, time_us), baro["drift_time_s"])
    baro["drift"] = decay * baro["drift"] + share * baro["drift_hpa"] * noise[1]
    if baro["is_frozen"] != 0:
        return
    altitude = baro["altitude"] - state[2]
    static, temperature_k = standard_pressure_hpa(altitude), SEA_LEVEL_K - LAPSE_K_M * altitude
    density = static * _PA_PER_HPA / (_GAS_J_KG_K * temperature_k)
    radius = baro["rotor_radius"]
    share = radius / (2.0 * max(baro["surface_z"] - state[2], _LEAST_RADII * radius))
    loading = 0.0
    for i in range(len(baro["disc_loading"])):
        loading += baro["disc_loading"][i] * rotor_speed[i] * abs(rotor_speed[i])
    near_pa = baro["ground_effect_share"] * loading * share * share
    dynamic_pa = baro["dynamic_share"] * 0.5 * density * airspeed_m_s * airspeed_m_s
    value = static + (near_pa + dynamic_pa) / _PA_PER_HPA
    value += baro["offset"] + baro["drift"] + baro["fault_bias"][0]
    spread = with_fault(baro["noise_hpa"], baro["fault_noise"])
    value = quantised(value + spread * noise[0], baro["resolution_hpa"])
    baro["out"][0] = value
    baro["out"][1] = pressure_altitude_m(max(value, 1.0))
    baro["out"][2] = temperature_k - 273.15


class Barometer:
    """The barometer of a vehicle."""

    def __init__(self, vehicle: Vehicle, seed: int, altitude_m: float) -> None:
        self.records: RecordArray = np.zeros(1, BARO)
        self.out: FloatArray = self.records["out"][0]
        """The last measurement."""
        self._call = measure_baro
        baro, self.noise = self.records[0], NormalStream(seed, "baro", width=2)
        write_numbers(baro, vehicle.sensors.numbers["baro"])
        radius = propeller_radius_m(vehicle)
        baro["altitude"] = altitude_m
        baro["rotor_radius"], baro["surface_z"] = radius, foot_z_m(vehicle)
        area = len(vehicle.rotors) * math.pi * radius * radius
        for index, rotor in enumerate(vehicle.rotors):
            baro["disc_loading"][index] = rotor.thrust_coefficient_n_s2 / area
        first, second = self.noise.first(2).tolist()
        baro["offset"], baro["drift"] = baro["turn_on_offset_hpa"] * first, baro["drift_hpa"] * second
        baro["measured_us"] = -1

    def measure(
        self, time_us: int, state: FloatArray, airspeed_m_s: float, rotor_speed: FloatArray
    ) -> FloatArray:
        """Measure at a state, an airspeed and the speeds [rad/s] of the rotors, shape (8,)."""
        arguments = (self.records, time_us, state, airspeed_m_s, rotor_speed, self.noise.row())
        if self._call is measure_baro:
            self._call = direct(measure_baro, *arguments)
        self._call(*arguments)
        return self.out
