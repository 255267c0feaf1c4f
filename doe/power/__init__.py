"""What planned readings would show of all that may be missing from a model, before anyone measures."""
