"""Entry point: ``python -m stiffarm`` and the installed command.

The libraries take seconds to load, and Python's answer to a Ctrl-C in that time, an exception out of whatever was
being imported, is lost in some of them and a traceback in others. So the process heeds Ctrl-C its own way from its
first line to its last.
"""

from stiffarm.interruption import heed_for_life


def main() -> None:
    """Load the command line and run it."""
    heed_for_life()
    from stiffarm.cli import app

    app(prog_name="stiffarm")


if __name__ == "__main__":
    main()
