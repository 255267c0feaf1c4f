"""The face of stiffarm: command line, reports, pictures.

Nothing is imported here: this runs before the command line can heed Ctrl-C.
"""

TYPE_CHECKING = False
if TYPE_CHECKING:
    __version__: str
else:

    def __getattr__(name: str) -> str:
        """The version, looked up when it is asked for."""
        if name != "__version__":
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib.metadata import version

        return version("stiffarm")
