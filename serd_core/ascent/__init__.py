"""Ways to climb an objective: who moves the parameters in line 9 of Algorithm 1."""
