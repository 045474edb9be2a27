"""The commands of `serd-bag`, which `serd bag` has too."""
