"""A session: a robot, its state, the table of commands that answer requests, and the loop: a line in, a line out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, BinaryIO

import numpy as np

import fem
from machining.cell import ArmBodies, Cell
from machining.service import poses, searches
from machining.service.asked import Arm, unit_of
from machining.service.state import State, state_of, vectors_of
from machining.service.wire import (
    LONGEST_LINE,
    MOST_ROWS,
    Fields,
    NotReadError,
    error_of,
    id_of,
    numbers,
    read_line,
    write_line,
)
from machining.stiffness.objective import QUANTITIES

# Raised when an old client would misread an answer; new keys and commands do not raise it.
PROTOCOL = 1
MOST_REQUESTS = 100_000


class Session(Arm):
    """A robot in its cell that answers requests.

    ``arm``: the arm's bodies, None: collisions are not looked at. ``facts``: what ``hello`` says besides, as versions
    and file names. ``stopped``: a request asked for the end.
    """

    def __init__(
        self,
        model: fem.ArmModel,
        cell: Cell,
        arm: ArmBodies | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(model, cell, arm)
        self.facts = dict(facts or {})
        self.stopped = False

    def answer(self, line: bytes) -> bytes:
        """The answer line to a request line; never raises but for Ctrl-C and the like."""
        try:
            request = read_line(line)
        except Exception as error:
            return write_line(self.failure(None, error))
        answer = self.reply(request)
        try:
            return write_line(answer)
        except ValueError as error:  # a number that JSON has none for
            return write_line(self.failure(answer["id"], error))

    def reply(self, request: Mapping[str, Any], within: str | None = None) -> dict[str, Any]:
        """The answer to a request; ``within``: the command that it is part of."""
        name: Any = None
        try:
            name = id_of(request)
            found = self._run(request, within)
        except Exception as error:
            return self.failure(name, error)
        return {"id": name, "ok": True, **found}

    def failure(self, name: Any, error: Exception) -> dict[str, Any]:
        """The answer to a request, ``name`` its id, that ended in an error."""
        return {"id": name, "ok": False, "error": error_of(error)}

    def _run(self, request: Mapping[str, Any], within: str | None) -> dict[str, Any]:
        do = request.get("do")
        allowed = [name for name in COMMANDS if within is None or name not in ("batch", "quit")]
        if not isinstance(do, str) or do not in allowed:
            where = "do" if within is None else f"do within {within}"
            raise Fields({}, "request").fault(where, do, ", ".join(allowed), 'as in {"do": "ping"}')
        return COMMANDS[do](self, Fields(request, do))


def serve(session: Session, requests: BinaryIO, write: Callable[[bytes], None], longest: int = LONGEST_LINE) -> None:
    """Answer each line of ``requests`` by one call of ``write``; ends at the end of input or at ``quit``.

    A last line without its end counts as one. Lines of more than ``longest`` bytes are passed over without being kept.
    """
    while not session.stopped:
        line = requests.readline(longest + 1)
        if not line:
            return
        if len(line) > longest and not line.endswith(b"\n"):
            while line and not line.endswith(b"\n"):
                line = requests.readline(longest)
            allowed, remedy = f"at most {longest} bytes", "ask in several requests"
            error = NotReadError("line", code="V001", value="too long", allowed=allowed, remedy=remedy)
            write(write_line(session.failure(None, error)))
            continue
        write(session.answer(line))


def hello(session: Session, fields: Fields) -> dict[str, Any]:
    """What is there: protocol, robot, cell, commands, quantities, limits."""
    fields.done()
    robot, cell = session.robot, session.start.cell
    joints = [
        {"name": name, "coordinate": coordinate, "lower_deg": low, "upper_deg": high}
        for name, coordinate, (low, high) in zip(
            robot.joint_names, robot.coordinates, numbers(np.degrees(robot.limits)), strict=True
        )
    ]
    axes = [
        {"name": a.name, "lower_mm": low, "upper_mm": high}
        for a in cell.linear_axes
        for low, high in [numbers(a.limits * 1e3)]
    ]
    table = None
    if cell.turntable is not None:
        limits = cell.turntable.limits
        low, high = (None, None) if limits is None else numbers(np.degrees(limits))
        table = {"lower_deg": low, "upper_deg": high}
    return {
        "protocol": PROTOCOL,
        **session.facts,
        "robot": robot.name,
        "joints": joints,
        "closed_form": not session.searched,
        "linear_axes": axes,
        "turntable": table,
        "collisions": session.scene is not None,
        "commands": list(COMMANDS),
        "quantities": {name: unit_of(name)[0] for name in QUANTITIES},
        "limits": {"line_bytes": LONGEST_LINE, "requests_of_a_batch": MOST_REQUESTS, "points_of_a_block": MOST_ROWS},
    }


def ping(session: Session, fields: Fields) -> dict[str, Any]:
    """Nothing."""
    fields.done()
    return {}


def set_state(session: Session, fields: Fields) -> dict[str, Any]:
    """Keep tool, part, travel, force and the like for the requests to come; without keys: say what is set."""
    reset = fields.flag("reset", False)
    state = state_of(fields, session.start if reset else session.state)
    force, direction = (
        _one(fields, key, kept) for key, kept in (("force_N", state.force), ("direction", state.direction))
    )
    fields.done()
    session.state = State(state.cell, state.travel, state.table, state.reference, state.relative_to, force, direction)
    return session.state.payload


def batch(session: Session, fields: Fields) -> dict[str, Any]:
    """Several requests in one line, answered in their order; errors stay with their request."""
    requests = fields.take("requests")
    fields.done()
    form = f"a list of at most {MOST_REQUESTS} requests, objects without batch and quit among them"
    if not isinstance(requests, list) or len(requests) > MOST_REQUESTS:
        raise fields.fault("requests", requests, form)
    for i, request in enumerate(requests):
        if not isinstance(request, dict):
            raise fields.fault(f"requests, number {i}", request, form)
    return {"answers": [session.reply(request, "batch") for request in requests]}


def quit_session(session: Session, fields: Fields) -> dict[str, Any]:
    """End the process after this answer."""
    fields.done()
    session.stopped = True
    return {}


def _one(fields: Fields, key: str, kept: Any) -> Any:
    given = vectors_of(fields, key, kept)
    if given is not None and given.ndim != 1:
        raise fields.fault(key, f"{len(given)} rows", "three numbers")
    return given


COMMANDS: dict[str, Callable[[Session, Fields], dict[str, Any]]] = {
    "hello": hello,
    "ping": ping,
    "set": set_state,
    "fk": poses.fk,
    "ik": poses.ik,
    "stiffness": poses.stiffness,
    "deflection": poses.deflection,
    "clearance": poses.clearance_of_poses,
    "best_angle": searches.best_angle,
    "best_path": searches.best_path,
    "best_base": searches.best_base,
    "batch": batch,
    "quit": quit_session,
}
