"""The vehicle as an assembly of bodies on MuJoCo; requires the extra ``multibody``."""
