"""G-code programs of milling machines."""
