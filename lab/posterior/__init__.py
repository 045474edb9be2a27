"""Draws from the posterior by chains, and the calibration of posteriors by simulation."""
