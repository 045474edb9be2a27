"""The experiments of the thesis: each a function from a frozen config to a table and figures."""
