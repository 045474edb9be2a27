"""The simulated world on topics: lock-step or live."""
