"""The commands `fit` and `query`."""
