"""Commands that run the experiments and studies."""
