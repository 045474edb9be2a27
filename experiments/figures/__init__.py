"""Figures of the experiments: tables in, matplotlib figures out."""
