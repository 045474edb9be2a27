"""Latent variables: actions that are hidden."""
