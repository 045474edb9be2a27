"""What commands print and write: terminal, tables, reports, paths."""
