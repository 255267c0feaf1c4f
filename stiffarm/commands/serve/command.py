"""The command `serve`: a process that answers a postprocessor's questions, line by line."""

from __future__ import annotations

import gc
import os
import sys
from typing import Annotated

import numpy as np
import typer

from fem.arm import Arm
from machining.service import Session, serve
from machining.service.wire import LONGEST_LINE
from machining.setup import Setup
from robots import InputError
from stiffarm import __version__
from stiffarm.path_request import FramesRequest, effects_left_out
from stiffarm.request import FRAME
from stiffarm.session.console import EXIT_OTHER, say, say_notes
from stiffarm.session.frame import command
from stiffarm.session.inputs import model_hash
from stiffarm.session.options import Debug, Links, LoadPathOpt, ModelArg, Sets
from stiffarm.session.stated import AtLoad, stated_table
from stiffarm.session.streams import CLOSED
from stiffarm.session.task_options import CellOpt, PartOpt, ToolOpt

MIB = 1024 * 1024


def serve_command(
    model: ModelArg,
    cell: CellOpt = None,
    tool: ToolOpt = None,
    part: PartOpt = None,
    longest: Annotated[
        int, typer.Option("--line-limit", metavar="MIB", help="Longest request line, in MiB.", min=1, max=1024)
    ] = LONGEST_LINE // MIB,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    debug: Debug = False,
) -> None:
    """Answer questions from other programs, line by line.

    Reads one JSON object per line on stdin and answers on stdout: kinematics, stiffness, best posture. Meant for
    postprocessors; docs/reference/serve.md describes the protocol. Ends at the end of the input.
    """
    with command(debug=debug) as frame:
        given = frame.model(model, links, load_path, sets=sets)
        given = frame.at_load(given, at_load)
        asked = FramesRequest(
            cell=cell,
            tool=None if tool is None else FRAME.read(tool, "--tool"),
            part=None if part is None else FRAME.read(part, "--part"),
        )
        # Without a cell nothing is looked at for collisions.
        setup = Setup(asked.described(given.robot)) if cell is None else asked.setup(given)
        say_notes(setup.notes)
        session = open_session(given, setup)
        answers = _claim_stdout()
        warm_up(session)
        say(f"stiffarm serve: {given.robot.name} is ready")
        try:
            serve(session, sys.stdin.buffer, answers.write, longest * MIB)
        except BrokenPipeError:  # nobody reads the answers any more
            raise typer.Exit(EXIT_OTHER) from None


def open_session(given: Arm, setup: Setup) -> Session:
    """A session, and what it says of itself."""
    facts = {
        "version": __version__,
        "model_hash": model_hash(given),
        "links": given.model.link_kind,
        "load_path": given.model.load_path,
        "effects_left_out": effects_left_out(given),
        **stated_table(given.model),
        # A cell of --tool and --part has no name of its own.
        "cell": None if setup.arm is None else setup.cell.name,
    }
    return Session(given.model, setup.cell, setup.arm, facts)


class _Answers:
    """The real stdout."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor

    def write(self, line: bytes) -> None:
        """Write all of a line."""
        # Ctrl-C may cut a long line short: to wait for a reader that does not read would be worse.
        rest = memoryview(line)
        while rest:
            rest = rest[os.write(self.descriptor, rest) :]


def _claim_stdout() -> _Answers:
    """Keep stdout for answers: whatever else is printed there goes to stderr from now on."""
    if closed := CLOSED & {"stdin", "stdout"}:
        raise InputError(
            f"{' and '.join(sorted(closed))} closed: requests come from stdin, and answers go to stdout",
            code="F012",
            allowed="pipes or files of a process",
            remedy="start it with both connected",
        )
    try:
        own = os.dup(sys.stdout.fileno())
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    except (OSError, ValueError) as error:
        raise InputError(
            "stdin and stdout", code="F012", value=str(error), allowed="pipes or files of a process"
        ) from None
    return _Answers(own)


def warm_up(session: Session) -> None:
    """Work out what the first requests would have to wait for, and keep it out of the garbage collector's way."""
    pose = np.degrees(session.robot.limits.mean(axis=1) + 0.1).tolist()
    session.reply({"do": "fk", "q_deg": pose})
    for do in ("stiffness", "deflection"):
        session.reply({"do": do, "q_deg": pose, "force_N": [0.0, 0.0, 1.0]})
    gc.collect()
    gc.freeze()
