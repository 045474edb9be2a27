"""How sure a fit can be: standard errors, confidence intervals, identifiability."""
