"""The people study: pedestrians of measured corridors as experts."""
