"""Likelihoods of decisions under a fit, and choosing among fits by them."""
