"""Entry point: ``python -m stiffarm`` and the installed command.

The libraries take seconds to load, and Python's answer to a Ctrl-C in that time, an exception out of whatever was
being imported, is lost in some of them and a traceback in others. So the process heeds Ctrl-C its own way from its
first line to its last.
"""

from stiffarm import refuse_strangers
from stiffarm.session.interruption import heed_for_life
from stiffarm.session.streams import plug, silence, tell

EXIT_BAD_INPUT = 2
EXIT_OTHER = 1


def main() -> None:
    """Load the command line and run it."""
    heed_for_life()
    plug()
    try:
        refuse_strangers()
    except ImportError as error:
        tell(f"stiffarm: {error}. More: stiffarm help X003")
        raise SystemExit(EXIT_BAD_INPUT) from None
    from stiffarm.cli import app

    try:
        app(prog_name="stiffarm")
    except OSError as error:  # of --help and --version, on a full disk; commands tell of theirs themselves
        tell(f"stiffarm: the system refused: {error}. More: stiffarm help X001")
        silence(1)  # Python would try to write the rest again at exit, and complain about that itself
        raise SystemExit(EXIT_OTHER) from None


if __name__ == "__main__":
    main()
