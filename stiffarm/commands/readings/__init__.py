"""The command `readings`."""
