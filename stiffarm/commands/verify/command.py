"""The command `verify`: a program replayed in its cell before the cell moves."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fem.arm import Arm
from machining.programs.formats import CONTROLLERS, neutral_twin, read_options, read_program
from machining.programs.write_options import WriteOptions
from machining.verification import Demands, Interpolation
from machining.verification import verify as verified
from stiffarm.capability import capability
from stiffarm.commands.verify.result import result
from stiffarm.request import FILE, argument, option, word
from stiffarm.result import Result
from stiffarm.session.console import progress
from stiffarm.session.path_request import FramesRequest, bodies_of
from stiffarm.session.table_kinds import PROGRAM, expect


@dataclass(frozen=True, kw_only=True)
class VerifyRequest(FramesRequest):
    """Check a program for collisions, limits and singularities.

    Also for speeds, branch changes and path deviations, before the cell moves. Exit code 0: no offence (there may be
    warnings); 1: offences, the worst one is named; 2: bad input. Writes report.html, replay.html, verification.json,
    verification.csv (the offences) and moves.csv into --out.
    """

    program: Path | str = argument(
        "Program written by `stiffarm post`: JSON or CSV, or the main file of a controller's.",
        FILE,
        metavar="PROGRAM",
        required=True,
    )
    interpolation: Interpolation = option(
        "Interpolation between points: joint (synchronised joint motion), linear (straight tool path) or mixed (linear "
        "while cutting).",
        word(Interpolation),
        default="joint",
    )
    safety: float | None = option(
        "Distance to keep from the surroundings, in mm. Default: the cell's safety distance.", metavar="MM"
    )
    resolution: float = option(
        "Resolution: moves are subdivided down to this motion, in mm.", metavar="MM", default=1.0
    )
    tolerance: float = option("Allowed tool-tip deviation from the programmed path, in mm.", metavar="MM", default=0.1)
    smoothing: float = option("Time over which the controller blends corners, in ms.", metavar="MS", default=50.0)
    singular: float = option("Least distance from singularities, 0 to 1.", default=Demands.singular_least, least=0.0)
    jump: float = option("Largest joint step without tool motion, in deg.", metavar="DEG", default=20.0)
    against: Path | str | None = option(
        "The neutral program of the same run, which a controller's program must agree with. Default: that in the "
        "folder json beside the program's folder.",
        FILE,
        metavar="JSON",
    )
    options: Path | str | None = option("Options that a controller's program was written with (TOML or JSON).", FILE)


def answer(given: Arm, asked: VerifyRequest) -> Result:
    """Whether the program may run, and what is wrong with it."""
    demands = Demands(
        interpolation=asked.interpolation,
        safety=None if asked.safety is None else 1e-3 * asked.safety,
        resolution=1e-3 * asked.resolution,
        tolerance=1e-3 * asked.tolerance,
        smoothing=1e-3 * asked.smoothing,
        singular_least=asked.singular,
        jump=float(np.radians(asked.jump)),
    )
    # Programs are the controller's, which computes with the arm as designed.
    arm, program = given.as_designed, Path(asked.program)
    if program.suffix.lower() not in CONTROLLERS:
        expect(program, PROGRAM)
    options = WriteOptions() if asked.options is None else read_options(Path(asked.options))
    twin = neutral_twin(program) if asked.against is None else Path(asked.against)
    checked = read_program(program, arm.robot, asked.described(arm.robot), options, twin)
    bodies = bodies_of(arm.source, arm.description, checked.cell)
    with progress("moves checked") as bar:
        return result(arm, verified(checked, bodies, demands, progress=bar))


verify = capability("verify", VerifyRequest, answer, is_built=False)
