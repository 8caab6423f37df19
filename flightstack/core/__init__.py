"""Types, arrays, geometry, geodesy and compilation, used by every other package."""
