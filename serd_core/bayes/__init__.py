"""Bayesian SERD: evidence, posterior distributions and their draws, information."""
