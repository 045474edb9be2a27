"""Files people keep: strict YAML, atomic writes, model, decision table and grid files."""
