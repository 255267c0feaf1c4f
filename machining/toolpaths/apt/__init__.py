"""APT and CLSF files."""
