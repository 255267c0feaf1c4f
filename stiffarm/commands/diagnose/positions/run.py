"""From tables of positions and the options of `diagnose` to what is missing, its answer and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from doe.absolute.missing.diagnose import diagnose_positions
from doe.absolute.table import joined, read_absolute
from fem.arm import Arm
from stiffarm.commands.diagnose.positions import payload, words
from stiffarm.session import parsing
from stiffarm.session.console import say, say_notes
from stiffarm.session.frame import Frame


def diagnose_tables(
    frame: Frame, given: Arm, data: Sequence[Path], refused: Mapping[str, Any], *, holdout: Path | None, seed: int
) -> None:
    """Diagnose by tables of positions; options in ``refused`` have no meaning here.

    Raises
    ------
    InputError
        One of those options was given; a table or readings that cannot be used.
    """
    parsing.refuse_given(dict(refused), "no option for tables of positions", "leave it out")
    frame.reads(holdout=holdout)
    read = [read_absolute(file, given.robot) for file in data]
    table = joined(read)
    frame.files |= {f"data_{k}" if k > 1 else "data": one.sha256 for k, one in enumerate(read, start=1)}
    kept = None if holdout is None else read_absolute(holdout, given.robot)
    say_notes((*table.notes, *(() if kept is None else kept.notes)))
    with frame.folder_if(seed) as folder:
        with frame.timed("diagnosis"):
            found = diagnose_positions(given.model, table, holdout=kept, seed=seed, progress=say)
        content = payload.missing(given, found)
        if folder is not None:
            from stiffarm.commands.diagnose.positions.report import write_report

            folder.write_json("diagnosis.json", content)
            with folder.timed("report"):
                write_report(given, found, folder)
    frame.answer(content, lambda: words.show(found))
