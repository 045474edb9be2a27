"""Bellman backups and linear systems of many states, compiled by numba (the extra `fast`)."""
