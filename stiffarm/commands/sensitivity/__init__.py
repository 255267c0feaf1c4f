"""The command `sensitivity`."""
