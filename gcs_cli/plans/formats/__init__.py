"""Formats of other programs: KML, GPX and GeoJSON."""
