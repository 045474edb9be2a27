"""Bayesian SERD: evidence, posterior distributions and their samples, calibration."""
