"""Tabular MDPs, Bellman solvers, policies, outcome models, priors, learners, arrival times."""
