"""Latent variables: actions that are hidden, types of experts that are not labelled."""
