"""Derivatives of values, policies and posteriors by rewards and dynamics."""
