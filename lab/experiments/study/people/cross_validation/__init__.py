"""Folds of people: what learns, predicts and is scored on those who are held out."""
