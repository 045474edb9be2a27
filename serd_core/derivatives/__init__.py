"""First and second derivatives of Q-functions and posteriors."""
