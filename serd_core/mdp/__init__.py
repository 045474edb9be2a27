"""Markov decision processes without reward, and learning problems on them."""
