"""Faults injected into running stacks."""
