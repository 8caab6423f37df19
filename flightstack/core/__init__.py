"""Types, arrays, geometry, geodesy and compilation: what every other package builds on."""
