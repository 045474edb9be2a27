"""Estimators of rewards (and dynamics) from demonstrations, one file each."""
