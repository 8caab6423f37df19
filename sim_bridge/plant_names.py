"""Names of the plants, for the command line: without loading what they are made of."""

from flightstack.core.errors import INSTALL_MULTIBODY

MULTIBODY = "multibody"
PLANT_NAMES = ("rigid", "paper", MULTIBODY)

NO_MUJOCO = f"the multibody plant needs MuJoCo: {INSTALL_MULTIBODY}"
