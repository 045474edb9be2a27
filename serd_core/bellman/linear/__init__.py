"""Solvers of the linear systems of Newton's method and of gradients."""
