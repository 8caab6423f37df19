"""The masses of an assembly as a table: what each part weighs, how far it was tuned, and what is missed."""

from __future__ import annotations

import numpy as np

from flightstack.params.vehicle import Vehicle
from sim_bridge.multibody.assembly import Assembly
from sim_bridge.multibody.placing import of_body, place
from sim_bridge.multibody.usual_parts import Knobs, usual_parts


def tuned_masses(vehicle: Vehicle, assembly: Assembly) -> dict[str, float]:
    """Return by part the mass over what it would be untuned: the usual part's, or that of the vehicle file."""
    given = [placed for part in vehicle.parts for placed in place(vehicle, part)]
    untuned = {placed.part.name: placed for placed in [*usual_parts(vehicle, Knobs()), *given]}
    return {
        placed.part.name: placed.properties().mass_kg / untuned[placed.part.name].properties().mass_kg
        for placed in assembly.parts
    }


def mass_table(vehicle: Vehicle, assembly: Assembly) -> str:
    """Return a table of the parts with material, density and mass, and of the whole beside the vehicle file."""
    lines = [*_part_rows(vehicle, assembly), "", *_whole_rows(vehicle, assembly)]
    products = max(assembly.misses[name] for name in ("Ixy", "Ixz", "Iyz"))
    lines.append(f"products of inertia are below {products:.1e} of the largest moment")
    lines.append("the density of what turns is free: it gives each rotor its J")
    return "\n".join(lines)


def _part_rows(vehicle: Vehicle, assembly: Assembly) -> list[str]:
    rows = [
        f"{'part':<16}{'shape':<10}{'material':<13}{'kg/m³':>8}{'g':>10}{'× usual':>9}"
        f"{'x':>10}{'y':>10}{'z, m FRD':>10}"
    ]
    factors = tuned_masses(vehicle, assembly)
    for placed in assembly.parts:
        part, own = placed.part, placed.properties()
        x, y, z = own.centre_m
        if placed.body:
            x, y, z = own.centre_m + np.array(vehicle.rotors[placed.body - 1].position_frd_m)
        rows.append(
            f"{part.name:<16}{part.shape:<10}{part.material:<13}{part.density_kg_m3:>8.0f}"
            f"{own.mass_kg * 1e3:>10.2f}{factors[part.name]:>9.2f}{x:>10.4f}{y:>10.4f}{z:>10.4f}"
        )
    return rows


def _whole_rows(vehicle: Vehicle, assembly: Assembly) -> list[str]:
    whole, misses = assembly.whole, assembly.misses
    moments = np.diag(whole.inertia_kg_m2)
    rows = [("mass, kg", whole.mass_kg, vehicle.mass_kg, "mass")]
    rows += [
        (f"{name}, kg m²", float(value), wanted, name)
        for name, value, wanted in zip(("Ix", "Iy", "Iz"), moments, vehicle.inertia_kg_m2, strict=True)
    ]
    rows += [
        (f"centre of gravity {axis}, m", float(value), 0.0, f"centre of gravity {axis}")
        for axis, value in zip("xyz", whole.centre_m, strict=True)
    ]
    for number, rotor in enumerate(vehicle.rotors, start=1):
        about_axis = float(of_body(assembly.parts, number).inertia_kg_m2[2, 2])
        name = f"inertia of rotor {number}"
        rows.append((f"rotor {number} J, kg m²", about_axis, rotor.inertia_kg_m2, name))
    return [f"{'':<24}{'assembly':>16}{'vehicle file':>16}{'miss':>10}"] + [
        f"{title:<24}{value:>16.8g}{wanted:>16.8g}{misses[name]:>10.1e}"
        for title, value, wanted, name in rows
    ]
