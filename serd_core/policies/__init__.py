"""Models pi = g(theta_P, Q) of how an expert chooses actions (section 4.4)."""
