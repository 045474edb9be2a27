"""Likelihood of demonstrations: of the choices and of what the world made of them (Eq. 4.7)."""
