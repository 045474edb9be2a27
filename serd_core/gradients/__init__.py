"""Derivatives of the converged Q-function: by adjoint, and the thesis's forward recursions."""
