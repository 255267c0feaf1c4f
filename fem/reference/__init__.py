"""Independent solutions that the production path is held against."""
