"""Decisions that take time: dwell times as part of dynamics (semi-Markov decision processes)."""
