"""Exact second derivatives of the log posterior, and first derivatives per decision."""
