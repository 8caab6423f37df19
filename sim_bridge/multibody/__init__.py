"""The vehicle as an assembly of bodies on MuJoCo, and the pictures of it; needs the extra ``multibody``."""
