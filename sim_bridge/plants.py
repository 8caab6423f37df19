"""Plants by their names."""

from __future__ import annotations

from flightstack.params.vehicle import Vehicle
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.disturbance import check_wind
from sim_bridge.plant.plant import Plant, PlantOptions
from sim_bridge.plant_names import MULTIBODY, NO_MUJOCO

_KERNELS = ("settle", "quaternion_from_euler", "rotate")


def kernels_of(plant: str) -> tuple[str, ...]:
    """Names of the kernels that a simulator with this plant compiles, or reads from the cache."""
    return (*_KERNELS, *(("show_pose", "show_state") if plant == MULTIBODY else ("_advance",)))


def make_plant(vehicle: Vehicle, name: str, options: PlantOptions) -> Plant:
    """Return the plant of this name, one of ``plant_names``.

    Raises UsageProblemError where MuJoCo is not installed or wind cannot act, ConfigError for a mesh that is not
    a solid.
    """
    check_wind(vehicle, name, options.disturbance)
    if name != MULTIBODY:
        return CompiledPlant(vehicle, name, options)
    try:
        from sim_bridge.multibody.plant import MultibodyPlant  # noqa: PLC0415  # an extra, and slow to load
    except ImportError:
        raise UsageProblemError(NO_MUJOCO) from None
    return MultibodyPlant(vehicle, options)
