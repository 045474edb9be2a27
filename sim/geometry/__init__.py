"""Plane geometry and the map as a raster."""
