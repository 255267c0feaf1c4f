"""The command `run`: the whole chain from readings to maps."""
