"""How Bellman equations and their linear systems are solved; choose by object."""
