"""The command `robots`."""
