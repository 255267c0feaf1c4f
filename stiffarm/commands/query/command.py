"""The command `query`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from fem.statics.stated import at_load_entry
from robots import InputError, content_hash
from robots.arrays import Array
from robots.files.csv_text import records_text
from stiffarm.commands.query import answers
from stiffarm.session import parsing
from stiffarm.session.console import say, say_notes
from stiffarm.session.frame import command
from stiffarm.session.options import Debug, Json, Out
from stiffarm.session.table_kinds import SURROGATE, described, expect
from surrogate import Surrogate, load_surrogate
from surrogate import query as ask
from surrogate.asking import SINGULARITY_ROWS
from surrogate.model import COMPLIANCE


def query(
    surrogate_file: Annotated[
        Path, typer.Argument(metavar="SURROGATE", help="Surrogate file (surrogate.json) written by `stiffarm fit`.")
    ],
    table: Annotated[
        Path | None,
        typer.Argument(
            metavar="[POSES]", help="Table of poses (CSV/XLSX) with one column per joint coordinate, in deg."
        ),
    ] = None,
    pose: Annotated[
        list[str] | None,
        typer.Option(
            "--pose",
            help="Joint coordinates in deg, as in q2_deg=5,q3real_deg=77.5; coordinates not given are 0. May "
            "be repeated.",
        ),
    ] = None,
    extrapolate: Annotated[
        bool, typer.Option("--extrapolate", help="Also answer outside the fitted domain; such answers are flagged.")
    ] = False,
    direction: Annotated[
        str | None,
        typer.Option(
            "--direction",
            help="Load direction in base axes; requires a surrogate with the factored basis. Default: that of "
            "the surrogate.",
        ),
    ] = None,
    matrix: Annotated[
        bool,
        typer.Option(
            "--matrix",
            help="Also return the 6 x 6 compliance in SI units; requires a surrogate with the factored basis.",
        ),
    ] = False,
    of: Annotated[
        str | None,
        typer.Option("--model", metavar="MODEL", help="Refuse the surrogate unless it was fitted to this model."),
    ] = None,
    singularity: Annotated[
        bool | None,
        typer.Option(
            "--singularity/--no-singularity",
            help="Flag poses close to a singularity. Default: for up to 1000 poses.",
            show_default=False,
        ),
    ] = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Evaluate a surrogate at poses, with error bars.

    Poses outside the fitted domain, out of reach or close to a singularity are flagged.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        expect(surrogate_file, SURROGATE)
        learned = load_surrogate(surrogate_file)
        if of is not None:
            _require_same_model(learned, of, surrogate_file)
        along = None if direction is None else np.array(parsing.parse_direction(direction))
        degrees, labels, remarks = _poses(learned, pose, table)
        say_notes(tuple(remarks))
        result = ask(learned, np.radians(degrees), extrapolate=extrapolate, direction=along, singularity=singularity)
        rows = answers.query_rows(learned, degrees, labels, result, matrix=matrix)
        content: dict[str, Any] = {
            "robot": learned.robot,
            "quantity": learned.quantity.name,
            "quantity_in_words": learned.quantity.label,
            "load_direction": _load_direction(learned, along),
            "fixed_deg": dict(learned.fixed_deg),
            "errors": answers.surrogate_errors(learned),
            **at_load_entry(learned.at_load),
            "answers": rows,
        }
        # The first says how the links were modelled; the others, what a stiffness has in it and what not.
        say_notes(learned.notes[1:])
        frame.reads(surrogate=surrogate_file, poses=table)
        with frame.folder_if() as folder:
            if folder is not None:
                folder.write_json("query.json", content)
                folder.write_text("query.csv", records_text(rows))
        unanswered = int(np.count_nonzero(~result.answered))
        if unanswered:
            say(f"note: {unanswered} of {len(rows)} poses lie outside the fitted range and have no value: see flags")
        if singularity is None and len(rows) > SINGULARITY_ROWS:
            say(f"note: with more than {SINGULARITY_ROWS} poses, --singularity flags those close to one")
        frame.answer(content, lambda: answers.show_answers(learned, rows))


def _load_direction(learned: Surrogate, along: Array | None) -> list[float] | None:
    """The load direction of the answers; an index has none."""
    if learned.quantity.name != COMPLIANCE:
        return None
    return list(learned.load_direction) if along is None else [float(v) for v in along]


def _require_same_model(learned: Surrogate, name: str, file: Path) -> None:
    """Refuse a surrogate that was fitted to another robot, or to another model of it, than ``name``.

    Raises
    ------
    InputError
        It was.
    """
    description = described(name)
    refit = "fit one for it (`stiffarm fit`)"
    if learned.robot != description.name:
        raise InputError(
            f"surrogate {file} is of robot", code="A010", value=learned.robot, allowed=description.name, remedy=refit
        )
    own = content_hash(description)
    if learned.model_hash != own:
        raise InputError(
            f"surrogate {file} was fitted to a model with hash",
            code="A010",
            value=learned.model_hash[:12],
            allowed=own[:12],
            remedy=refit,
        )


def _poses(learned: Surrogate, pose: list[str] | None, table: Path | None) -> tuple[Array, list[str], list[str]]:
    """Poses (n, k) in deg for a query, from ``--pose`` or a table, with labels and remarks."""
    if (table is None) == (not pose):
        raise InputError(
            "query needs poses",
            code="A003",
            allowed="either --pose (one or more) or a table of poses",
            remedy=f"give one of the two, as in --pose {learned.inputs[0]}=5",
        )
    if table is not None:
        from stiffarm.session.pose_tables import read_pose_table

        # Where turning a coordinate changes nothing, a table may have it anywhere.
        held = {name: v for name, v in learned.fixed_deg.items() if learned.fixed_influence.get(name, 1.0) > 0.0}
        return read_pose_table(learned.inputs, held, table)
    values = [parsing.parse_pairs(text, "--pose", learned.inputs) for text in pose or ()]
    remarks = [
        f"{'pose' if len(rows) == 1 else 'poses'} {', '.join(rows)}: {name} is not given and taken as 0"
        for name in learned.inputs
        if (rows := [str(i + 1) for i, v in enumerate(values) if name not in v])
    ]
    degrees = np.array([[v.get(name, 0.0) for name in learned.inputs] for v in values])
    return degrees, [str(i + 1) for i in range(len(values))], remarks
