"""One module per executable; each has a `main` that is its entry point."""
