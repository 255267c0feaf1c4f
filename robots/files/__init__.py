"""Files in and out: read once and hashed, written whole or not at all."""
