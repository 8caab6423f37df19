"""Names of the plants, for the command line: without loading what they are made of."""

MULTIBODY = "multibody"
PLANT_NAMES = ("rigid", "paper", MULTIBODY)

NO_MUJOCO = "the multibody plant needs MuJoCo: pip install 'flightstack[multibody]'"
