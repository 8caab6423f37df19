"""The vehicle as an assembly of bodies on MuJoCo; needs the extra ``multibody``."""
