"""Bellman equations and the solvers for them."""
