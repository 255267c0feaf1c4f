"""The commands `simulate` and `robots`."""
