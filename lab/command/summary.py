"""The summary of results on the terminal."""

import pandas as pd

#: Numbers below this are written with an exponent: four decimals would lose their digits.
_SMALL = 1e-3


def print_results(rows: pd.DataFrame, title: str) -> None:
    """Print a table and its title."""
    print(title)
    print(rows.to_string(index=False, na_rep="", float_format=_text))


def _text(value: float) -> str:
    # Likelihoods next to one differ from zero in late digits only.
    return f"{value:.2e}" if 0.0 < abs(value) < _SMALL else f"{value + 0.0:.4f}"
