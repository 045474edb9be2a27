"""Mixtures of experts: latent types with rewards (and beliefs) of their own, shared dynamics."""
