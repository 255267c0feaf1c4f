"""Robots and links from surface files: `import`."""

from __future__ import annotations

from pathlib import Path

from fem.arm import Arm
from robots.urdf.reading import read_urdf
from stiffarm.capability import capability_without_arm
from stiffarm.commands.importing.request import ImportRequest
from stiffarm.commands.importing.results import of_link, of_robot
from stiffarm.commands.importing.step import import_into_model, import_robot
from stiffarm.result import Result
from stiffarm.session.console import progress
from stiffarm.session.table_kinds import described


def answer(asked: ImportRequest) -> Result:
    """A robot from its URDF, or a model with one of its links from a file.

    Raises
    ------
    InputError
        A URDF, meshes or a surface that cannot be used: all faults at once.
    """
    if asked.is_robot:
        urdf = read_urdf(asked.source, tip=asked.tip, base=asked.base)
        with progress("links") as bar:
            return of_robot(import_robot(urdf, asked, bar))
    given = asked.model.description if isinstance(asked.model, Arm) else described(str(asked.model))
    return of_link(import_into_model(given, asked), given, Path(asked.source).name)


import_arm = capability_without_arm("import", ImportRequest, answer, function="import_arm")
