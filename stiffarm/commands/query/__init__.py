"""What a surrogate answers on the command line."""
