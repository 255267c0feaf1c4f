"""Six stiffnesses at every joint from displacements and twists between neighbouring links."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from doe import Measurements, read_measurements
from doe.joint_twists import LawKind, TwistReadings, joined, read_twists, write_twists
from doe.joint_twists.checks import bending_ratio, diagonal_tests, loops
from doe.joint_twists.cycles import Branches
from doe.joint_twists.deflections import determined_together
from doe.joint_twists.flange import at_flange, held_out
from doe.joint_twists.identify import identify as identified
from doe.joint_twists.model_file import with_six_springs
from doe.joint_twists.substitute import (
    ORIGIN_M,
    SIZE_M,
    Compliances,
    Orientation,
    Window,
    compliances_of,
    stiffness_window,
)
from doe.joint_twists.synthetic import Campaign, draw_truth, make_readings, truth_table
from fem.arm import Arm
from robots import InputError, why_no_closed_form
from stiffarm.capability import capability
from stiffarm.commands.identify.results import Identification, result
from stiffarm.request import (
    READINGS,
    TABLE,
    Kind,
    Readings,
    Request,
    argument,
    numbers_of,
    option,
    readings_asked,
    seed,
    word,
)
from stiffarm.result import Result
from stiffarm.session.console import say
from stiffarm.session.inputs import refuse_effects, with_links
from stiffarm.session.parsing import parse_numbers
from stiffarm.session.table_kinds import DEFLECTIONS, TWISTS, expect
from stiffarm.session.table_kinds import Kind as TableKind

if TYPE_CHECKING:
    from stiffarm.session.outputs import OutputFolder

SYNTHETIC = "synthetic_joint_twists.csv"
USUAL = tuple(1e3 * v for v in (*ORIGIN_M, *SIZE_M))
# The paper's joint: twist about X against that about the gear axis.
RATIO_JOINT = 1


def _window(value: Any, name: str) -> tuple[float, ...]:
    allowed = "four numbers in mm: X, Z, width and height above 0"
    row = numbers_of(value, name, allowed)
    if len(row) != 4 or not all(0.0 < size < 1e5 for size in row[2:]):
        remedy = f"write them as in {_window_text(USUAL)}"
        raise InputError(name, code="A004", value=value, allowed=allowed, remedy=remedy)
    return row


def _window_text(values: Sequence[float]) -> str:
    return ",".join(f"{v:g}" for v in values)


WINDOW = Kind("X,Z,WIDTH,HEIGHT", lambda text, _: parse_numbers(text) or text, _window, _window_text)


@dataclass(frozen=True, kw_only=True)
class IdentifyRequest(Request):
    """Identify six stiffnesses per joint from joint twists.

    Joint twists are relative displacements and rotations of the two links of a joint. The links are taken as rigid:
    their deflection is in the joints' stiffnesses, each of which may vary with the joint angle. Writes the model with
    six springs per joint, tables, a map and a report into --out.

    Examples
    --------
    >>> import stiffarm as sa
    >>> found = sa.identify("tx200", synthetic=True, law="constant")
    >>> sorted(set(found.to_frame()["joint"]))
    ['j1', 'j2', 'j3', 'j4', 'j5', 'j6']
    """

    tables: Sequence[Path | str] | Path | str = argument(
        "One or more tables (CSV/XLSX) of relative displacements and rotations of neighbouring links, or of reflector "
        "coordinates.",
        TABLE,
        metavar="[TABLE]",
        several=True,
    )
    law: LawKind | None = option(
        "Law of each stiffness over its joint angle: constant, fourier-1, fourier-2 or table. Default: the fullest "
        "that its angles can determine.",
        word(LawKind),
    )
    branches: Branches = option(
        "Readings used: mean (of loading and unloading) or loading (loading only).", word(Branches), default="mean"
    )
    holdout: Readings | None = option(
        "Measurement table of flange deflections (CSV/XLSX), used only to test the prediction.", READINGS
    )
    flange: Orientation = option(
        "Flange orientation over the map: forward (Z along base X), base (parallel to the base) or down.",
        word(Orientation),
        default="forward",
    )
    window: Sequence[float] = option(
        "Window of the map in the plane Y = 0: X and Z of its corner, width and height, in mm.", WINDOW, default=USUAL
    )
    synthetic: bool = option("Simulate a measurement campaign for this model and identify from it.", default=False)
    confirm_units: bool = option(
        "Accept the table although its values look like other units; use it after checking them.", default=False
    )
    seed: int = seed()

    def links(self, model: str, given: str | None) -> str | None:
        """Rigid."""
        if given not in (None, "rigid"):
            raise InputError("--links", code="M003", value=given, allowed="rigid", remedy="leave it out")
        return "rigid"


def answer(given: Arm, asked: IdentifyRequest) -> Result:
    """Identify, check, compare with models of the gears alone."""
    if asked.synthetic and asked.tables:
        raise InputError("--synthetic and TABLE: one of them at a time", code="A002", remedy="leave one out")
    if not asked.synthetic and not asked.tables:
        raise InputError(
            "TABLE",
            code="A003",
            value="none",
            allowed="one or more tables of joint twists, CSV or XLSX",
            remedy="give your readings, or try --synthetic, which simulates some",
        )
    given = given if given.model.link_kind == "rigid" else with_links(given, "rigid")
    refuse_effects(given, "identification", "remove the [[effect]] tables: joints are identified anew")
    data, write = _simulated(given, asked.seed) if asked.synthetic else (_read(given, asked.tables), None)
    other = None
    if asked.holdout is not None:
        other = readings_asked(given, asked.holdout, confirm_units=asked.confirm_units)
    say(f"identifying six stiffnesses at {given.robot.dof} joints from {data.n} readings")
    found = identified(given.model, data, law=asked.law, branches=asked.branches)
    if not any(d.law is not None for d in found.directions.values()):
        remedy = "give readings of joints under loads that reach them"
        raise InputError(f"{data.source}: no stiffness is determined", code="J004", remedy=remedy)
    flange = at_flange(given.model, found, asked.seed)
    if isinstance(flange, str) and other is not None:
        remedy = "leave out --holdout, or measure those joints too"
        raise InputError(f"--holdout {other.source}: {flange}", code="J004", remedy=remedy)
    made = type(given).of(with_six_springs(given.description, found), "rigid", given.model.load_path, given.own)
    whole = Identification(
        made,
        found,
        loops(found),
        diagonal_tests(found),
        bending_ratio(found.directions, found.names[RATIO_JOINT]) if given.robot.dof > RATIO_JOINT else None,
        flange,
        flange if isinstance(flange, str) else _map(given, asked, compliances_of(found)),
        None if other is None else held_out(given.model, found, other),
    )
    return result(whole, asked.law, write)


def _map(given: Arm, asked: IdentifyRequest, six: Compliances) -> Window | str:
    if (reason := why_no_closed_form(given.robot)) is not None:
        return reason
    x, z, width, height = (1e-3 * float(v) for v in asked.window)
    return stiffness_window(given.model, six, orientation=asked.flange, origin_m=(x, z), size_m=(width, height))


def _read(given: Arm, tables: Any) -> TwistReadings:
    """One or more tables of joint twists or reflectors as one."""
    for table in tables:
        if not isinstance(table, Path) or not table.is_file():
            allowed = "an existing .csv or .xlsx"
            raise InputError("TABLE", code="A007", value=str(table), allowed=allowed, remedy="check the path")
        expect(table, TWISTS, better=lambda kind: _calibrate_command(given, kind, tables))
    return joined([read_twists(table, given.robot) for table in tables])


def _calibrate_command(given: Arm, kind: TableKind, tables: Sequence[Path]) -> str | None:
    """The command line for tables of tool deflections, with all turning stiffnesses that they determine together."""
    if kind is not DEFLECTIONS:
        return None
    try:
        data: list[Measurements] = [read_measurements(table, given.robot) for table in tables]
        names = determined_together(given, data)
    except InputError:
        return None
    # All tables in one go: the first one is FILE.
    more = "".join(f" {table}" for table in tables[1:])
    return f"`stiffarm calibrate MODEL FILE{more} --free {','.join(names)}`" if names else None


def _simulated(given: Arm, seed: int) -> tuple[TwistReadings, Callable[[OutputFolder], None]]:
    """Readings of a simulated campaign, read back from their table: identification sees nothing else; and its files."""
    rng = np.random.default_rng(seed)
    truth = draw_truth(given.model, rng)
    with TemporaryDirectory() as folder:
        path = Path(folder) / SYNTHETIC
        write_twists(make_readings(given.model, truth, Campaign(), rng), path, given.robot)
        table, data = path.read_bytes(), read_twists(path, given.robot)

    def write(folder: OutputFolder) -> None:
        folder.path(SYNTHETIC).write_bytes(table)
        folder.write_json(
            "synthetic_truth.json",
            {
                "synthetic": True,
                "seed": seed,
                "ln_k": "c0 + c1 cos q + c2 sin q, N/m or N m/rad",
                "springs": truth_table(truth),
                "friction_Nm": truth.friction.tolist(),
            },
        )

    return data, write


identify = capability("identify", IdentifyRequest, answer)
