"""Estimators of the thesis that the library does not need: ascent, starts, stops, gradients."""
