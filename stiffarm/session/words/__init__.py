"""How directions, noise and springs are said, the same in all commands."""
