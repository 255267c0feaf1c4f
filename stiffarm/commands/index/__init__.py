"""The command `index`."""
