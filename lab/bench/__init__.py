"""The table of the field: ten tasks, a file per method, one table of what each reaches."""
