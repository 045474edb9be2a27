"""One module per executable, some in packages; each has a `main` that is its entry point."""
