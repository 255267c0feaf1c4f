"""The report of `run`, chapter by chapter."""
