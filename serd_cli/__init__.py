"""The `serd` command: run a node, launch a stack, the whole demo; every subcommand in its file."""
