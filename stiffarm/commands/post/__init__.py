"""The command `post`."""
