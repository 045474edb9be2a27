"""Commands of `python -m lab`: options, progress and tables on the terminal."""
