"""Route choice with many destinations and no discount: the recursive logit."""
