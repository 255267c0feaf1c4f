"""A power analysis: what a planned sheet would show, before anyone measures."""
