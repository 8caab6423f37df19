"""The plants by name."""

from __future__ import annotations

from flightstack.core.errors import INSTALL_MULTIBODY
from flightstack.params.vehicle import Vehicle
from sim_bridge.errors import UsageProblemError
from sim_bridge.plant.compiled_plant import CompiledPlant
from sim_bridge.plant.disturbance import check_wind
from sim_bridge.plant.plant import Plant, PlantOptions

MULTIBODY = "multibody"
PLANT_NAMES = ("rigid", "paper", MULTIBODY)
NO_MUJOCO = f"the multibody plant needs MuJoCo: {INSTALL_MULTIBODY}"

_KERNELS = ("settle", "note_battery", "quaternion_from_euler", "rotate")


def kernels_of(plant: str) -> tuple[str, ...]:
    """Return the names of the kernels that a simulator with this plant compiles or reads from the cache."""
    return (*_KERNELS, *(("show_pose", "show_state") if plant == MULTIBODY else ("_advance",)))


def make_plant(vehicle: Vehicle, name: str, options: PlantOptions) -> Plant:
    """Return a plant by its name, one of ``PLANT_NAMES``.

    Raises UsageProblemError if MuJoCo is not installed or wind cannot act, ConfigError for a mesh that is not a solid.
    """
    check_wind(vehicle, name, options.disturbance)
    if name != MULTIBODY:
        return CompiledPlant(vehicle, name, options)
    try:
        from sim_bridge.multibody.plant import MultibodyPlant
    except ImportError:
        raise UsageProblemError(NO_MUJOCO) from None
    return MultibodyPlant(vehicle, options)
