"""Log priors over parameter blocks (section 4.5), up to their constant Z."""
