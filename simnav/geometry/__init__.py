"""Geometry of navigation: the WGS-84 ellipsoid with its gravity (`earth`), and rotations (`rotation`)."""
