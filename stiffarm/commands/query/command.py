"""The command `query`, and surrogates as Python holds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from robots import InputError
from robots.arrays import Array
from robots.frames import unit_vector
from robots.quantities import angle
from stiffarm.capability import called, capability_without_arm
from stiffarm.commands.query.answers import Answers, answered
from stiffarm.request import (
    DIRECTION,
    POSE,
    TABLE,
    ByName,
    Given,
    Poses,
    Request,
    argument,
    in_order,
    option,
)
from stiffarm.result import Result, Table
from stiffarm.session.table_kinds import SURROGATE, described, expect
from surrogate import Surrogate as Learned
from surrogate import load_surrogate as read
from surrogate import query as ask
from surrogate.asking import SINGULARITY_ROWS

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Surrogate(Result):
    """A surrogate of an arm: made by :func:`stiffarm.fit`, or read by :func:`stiffarm.load_surrogate`."""

    learned: Learned

    def query(self, q_deg: Mapping[str, float] | Sequence[Mapping[str, float]] | pd.DataFrame, **asked: Any) -> Answers:
        """Value at poses with its 95 % interval and flags; outside of what was learned there is no value.

        ``q_deg``: joint coordinates in degrees by name, for one pose, several, or a data frame with one row a pose; an
        input that is not named is 0. What else may be asked: :func:`stiffarm.query`.
        """
        if isinstance(q_deg, Mapping | Sequence):
            return query(surrogate=self, pose=q_deg, **asked)
        return query(surrogate=self, poses=q_deg, **asked)

    def to_frame(self, table: str | None = None) -> pd.DataFrame:
        """One row an input: its name and the range that it was learned over, in degrees; or another table."""
        return super().to_frame("inputs" if table is None else table)

    def save(self, folder: str | Path) -> Path:
        """Write all files into a folder, or the surrogate alone into a file; returns the path.

        A file is a .json for :func:`stiffarm.load_surrogate` and ``stiffarm query``; for other programs a C99 header
        (.h), Python without imports (.py), JavaScript (.js) or .onnx.

        Raises
        ------
        InputError
            Another ending, or no package onnx.
        """
        from surrogate import save_surrogate
        from surrogate.portable.files import ENDINGS, portable, require_formats, write_one

        path = Path(folder)
        ending = path.suffix.lower()
        if not ending and self.found is not None:
            return super().save(path)
        if ending not in (known := (".json", *ENDINGS)):
            raise InputError(
                "surrogate file", code="B004", value=str(path), allowed=f"a name ending in {', '.join(known)}"
            )
        with called():
            if ending == ".json":
                save_surrogate(self.learned, path)
            else:
                require_formats((ENDINGS[ending],))
                write_one(portable(self.learned), path)
        return path


def load_surrogate(file: str | Path) -> Surrogate:
    """Read a surrogate's JSON file, as ``stiffarm fit`` and :meth:`Surrogate.save` write it.

    Raises
    ------
    InputError
        No such file, a file that is damaged, or one that is no surrogate.
    """
    with called():
        learned = read(Path(file))
    return Surrogate(
        name="surrogate",
        title=f"Surrogate of {learned.robot}",
        question="how far to trust it?",
        answer=errors_words(learned),
        tables=(inputs_table(learned),),
        remarks=learned.notes[1:],
        learned=learned,
    )


def errors_words(learned: Learned) -> str:
    """Basis, and errors on runs it has not seen."""
    e = learned.errors
    return f"{learned.basis}, error on unseen runs {e.rms_relative:.1e} RMS, {e.max_relative:.1e} at worst"


def inputs_table(learned: Learned) -> Table:
    """Ranges that a surrogate was learned over."""
    return Table(
        "inputs",
        "Inputs",
        {"input": learned.inputs, "whole_turns_removed": [bool(p) for p in learned.periodic]},
        {angle("from"): learned.lower, angle("to"): learned.upper},
        folded=True,
    )


@dataclass(frozen=True, kw_only=True)
class QueryRequest(Request):
    """Evaluate a surrogate at poses, with error bars.

    Poses outside the fitted domain, out of reach or close to a singularity are flagged.
    """

    surrogate: Surrogate | Path | str = argument(
        "Surrogate file (surrogate.json) written by `stiffarm fit`.", TABLE, metavar="SURROGATE", required=True
    )
    poses: Poses | None = argument(
        "Table of poses (CSV/XLSX) with one column per joint coordinate, in deg.", TABLE, metavar="[POSES]"
    )
    pose: Given = option(
        "Joint coordinates in deg, as in q2_deg=5,q3real_deg=77.5; coordinates not given are 0. May be repeated.",
        POSE,
        several=True,
    )
    extrapolate: bool = option("Also answer outside the fitted domain; such answers are flagged.", default=False)
    direction: Sequence[float] | None = option(
        "Load direction in base axes; requires a surrogate with the factored basis. Default: that of the surrogate.",
        DIRECTION,
    )
    matrix: bool = option(
        "Also return the 6 x 6 compliance in SI units; requires a surrogate with the factored basis.", default=False
    )
    model: str | None = option("Refuse the surrogate unless it was fitted to this model.", metavar="MODEL")
    singularity: bool | None = option(
        "Flag poses close to a singularity. Default: for up to 1000 poses.",
        spelled=("--singularity/--no-singularity",),
    )


def answer(asked: QueryRequest) -> Answers:
    """The surrogate's answers."""
    learned = _learned(asked.surrogate)
    if asked.model is not None:
        _require_same_model(learned, asked.model)
    along = None if asked.direction is None else unit_vector(np.asarray(asked.direction), "--direction")
    degrees, labels, remarks = _poses(learned, asked)
    result = ask(
        learned, np.radians(degrees), extrapolate=asked.extrapolate, direction=along, singularity=asked.singularity
    )
    if asked.singularity is None and len(degrees) > SINGULARITY_ROWS:
        remarks.append(f"with more than {SINGULARITY_ROWS} poses, --singularity flags those close to one")
    return answered(learned, degrees, labels, result, direction=along, matrix=asked.matrix, remarks=remarks)


def _learned(given: Surrogate | Path | str) -> Learned:
    if not isinstance(given, str | Path):
        return given.learned
    expect(Path(given), SURROGATE)
    return read(Path(given))


def _require_same_model(learned: Learned, name: str) -> None:
    """Refuse a surrogate that was fitted to another robot, or to another model of it, than ``name``.

    Raises
    ------
    InputError
        It was.
    """
    from robots import content_hash

    description = described(name)
    refit = "fit one for it (`stiffarm fit`)"
    if learned.robot != description.name:
        raise InputError(
            "surrogate is of robot", code="A010", value=learned.robot, allowed=description.name, remedy=refit
        )
    own = content_hash(description)
    if learned.model_hash != own:
        raise InputError(
            "surrogate was fitted to a model with hash",
            code="A010",
            value=learned.model_hash[:12],
            allowed=own[:12],
            remedy=refit,
        )


def _poses(learned: Learned, asked: QueryRequest) -> tuple[Array, list[str], list[str]]:
    """Poses (n, k) in deg, with labels and remarks."""
    if (asked.poses is None) == (not asked.pose):
        raise InputError(
            "query needs poses",
            code="A003",
            allowed="either --pose (one or more) or a table of poses",
            remedy=f"give one of the two, as in --pose {learned.inputs[0]}=5",
        )
    if isinstance(asked.poses, Path):
        from stiffarm.session.pose_tables import read_pose_table

        # Where turning a coordinate changes nothing, a table may have it anywhere.
        held = {name: v for name, v in learned.fixed_deg.items() if learned.fixed_influence.get(name, 1.0) > 0.0}
        return read_pose_table(learned.inputs, held, asked.poses)
    if asked.poses is not None:
        degrees = _of_frame(asked.poses, learned.inputs)
        return degrees, list(map(str, range(1, len(degrees) + 1))), []
    poses = cast("Sequence[ByName]", asked.pose)
    degrees = np.array([in_order(one, learned.inputs, "--pose", "number of degrees") for one in poses])
    remarks = [
        f"{'pose' if len(rows) == 1 else 'poses'} {', '.join(rows)}: {name} is not given and taken as 0"
        for name in learned.inputs
        if (rows := [str(i + 1) for i, one in enumerate(poses) if isinstance(one, Mapping) and name not in one])
    ]
    return degrees, list(map(str, range(1, len(poses) + 1))), remarks


def _of_frame(poses: pd.DataFrame, inputs: tuple[str, ...]) -> Array:
    """Angles (n, k) of the inputs; many rows are read at once, and only a wrong one by itself."""
    names = [str(name) for name in poses.columns]
    in_order(dict.fromkeys(names, 0.0), inputs, "poses", "number of degrees")
    out = given = np.array(poses, dtype=np.float64)
    if tuple(names) != inputs:
        out = np.zeros((len(poses), len(inputs)))
        out[:, [inputs.index(name) for name in names]] = given
    if not np.isfinite(out).all():
        row = np.flatnonzero(~np.isfinite(out).all(axis=1))[0]
        in_order(dict(zip(inputs, out[row].tolist(), strict=True)), inputs, "poses", "number of degrees")
    return out


query = capability_without_arm("query", QueryRequest, answer)
