"""Bellman equations: what is solved. How it is solved is in `serd_core.solvers`."""
