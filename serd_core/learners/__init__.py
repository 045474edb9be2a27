"""Estimators of rewards, and of dynamics with them, from demonstrations (docs/library.md)."""
