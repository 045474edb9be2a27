"""The log posterior of Eq. 4.9: parameters, beliefs, likelihoods."""
