"""Surrogates: the stiffness of an arm learned over its joint angles, asked for poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from robots import InputError, require_one_of
from stiffarm.face.arms import Arm
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame
from stiffarm.request import in_order
from surrogate.model import Surrogate as Learned

if TYPE_CHECKING:
    import pandas as pd

    from robots.arrays import Array
from robots.constants import DOWN


@dataclass(frozen=True, repr=False)
class Answers(Shown):
    """What a surrogate answered: ``frame`` has one row a pose, with its 95 % interval and flags in words."""

    frame: pd.DataFrame
    quantity: str

    def title(self) -> str:
        """What was asked of how many poses."""
        return f"{self.quantity} at {len(self.frame)} pose{'' if len(self.frame) == 1 else 's'}"

    def to_frame(self) -> pd.DataFrame:
        """One row a pose: its angles, the value, the ends of its 95 % interval, flags."""
        return self.frame

    @property
    def values(self) -> Array:
        """The values (n,), in the unit that their column's name says; NaN where not answered."""
        return np.asarray(self.frame[self.quantity], dtype=np.float64)


@dataclass(frozen=True, repr=False)
class Surrogate(Shown):
    """A surrogate of an arm. Made by :func:`stiffarm.fit` or :func:`stiffarm.load_surrogate`."""

    learned: Learned

    def title(self) -> str:
        """Robot, basis, and errors on runs it has not seen."""
        e = self.learned.errors
        of = (
            f"Surrogate of {self.learned.robot}: {self.learned.basis}, error on unseen runs {e.rms_relative:.1e} RMS, "
            f"{e.max_relative:.1e} at worst"
        )
        return ". ".join((of, *self.learned.notes[1:]))

    def to_frame(self) -> pd.DataFrame:
        """One row an input: its name and the range that it was learned over, in degrees."""
        low, high = np.degrees(self.learned.lower), np.degrees(self.learned.upper)
        return frame({"input": self.learned.inputs, "from_deg": low, "to_deg": high})

    def query(
        self,
        q_deg: Mapping[str, float] | Sequence[Mapping[str, float]] | pd.DataFrame,
        *,
        extrapolate: bool = False,
        direction: Sequence[float] | None = None,
        singularity: bool | None = None,
    ) -> Answers:
        """Value at poses with its 95 % interval and flags; outside of what was learned there is no value.

        Parameters
        ----------
        q_deg : joint coordinates in degrees by name, for one pose, several, or a data frame with one row a pose;
            an input that is not named is 0
        extrapolate : answer outside of the domain too, flagged
        direction : another load direction, base axes; needs the factored basis
        singularity : flag poses near a singularity; default: for up to 1000 poses, since it takes many times as long

        Raises
        ------
        InputError
            A coordinate that the surrogate does not have, or an angle that is no finite number.
        """
        from stiffarm.commands.query.answers import flag_words, query_columns, value_name
        from surrogate import query

        degrees = _degrees(q_deg, self.learned.inputs)
        along = None if direction is None else np.array(direction, dtype=np.float64)
        with called():
            result = query(
                self.learned, np.radians(degrees), extrapolate=extrapolate, direction=along, singularity=singularity
            )
            found = query_columns(self.learned, degrees, result)
        return Answers(frame({**found, "flags": flag_words(result)}), value_name(self.learned)[0])

    def save(self, file: str | Path) -> Path:
        """Write the surrogate; returns the path.

        ``file``: .json for :func:`stiffarm.load_surrogate` and ``stiffarm query``; for other programs a C99 header
        (.h), Python without imports (.py), JavaScript (.js) or .onnx.

        Raises
        ------
        InputError
            Another ending, or no package onnx.
        """
        from stiffarm.commands.fit.portable import ENDINGS, parse_formats, portable, write_one
        from surrogate import save_surrogate

        path = Path(file)
        ending = path.suffix.lower()
        if ending not in (known := (".json", *ENDINGS)):
            raise InputError(
                "surrogate file", code="B004", value=str(path), allowed=f"a name ending in {', '.join(known)}"
            )
        with called():
            if ending == ".json":
                save_surrogate(self.learned, path)
            else:
                parse_formats(ENDINGS[ending])
                write_one(portable(self.learned), path)
        return path


def _degrees(
    q_deg: Mapping[str, float] | Sequence[Mapping[str, float]] | pd.DataFrame, inputs: tuple[str, ...]
) -> Array:
    """Angles (n, k) of the inputs."""

    def one(pose: Mapping[str, float]) -> list[float]:
        return list(in_order(pose, inputs, "q_deg", "number of degrees"))

    if isinstance(q_deg, Mapping | Sequence):
        found = [one(pose) for pose in ([q_deg] if isinstance(q_deg, Mapping) else q_deg)]
        return np.array(found, dtype=np.float64).reshape(len(found), len(inputs))
    names = [str(name) for name in q_deg.columns]
    one(dict.fromkeys(names, 0.0))
    out = given = np.array(q_deg, dtype=np.float64)
    if tuple(names) != inputs:
        out = np.zeros((len(q_deg), len(inputs)))
        out[:, [inputs.index(name) for name in names]] = given
    if not np.isfinite(out).all():
        row = np.flatnonzero(~np.isfinite(out).all(axis=1))[0]
        one(dict(zip(inputs, out[row].tolist(), strict=True)))
    return out


def fit(
    arm: Arm,
    *,
    inputs: Sequence[str] | None = None,
    basis: Literal["best", "polynomial", "trigonometric", "factored", "adaptive"] = "best",
    degree: int = 6,
    runs: int | None = None,
    direction: Sequence[float] = DOWN,
    at_load_N: float | None = None,
    seed: int = 0,
) -> Surrogate:
    """Learn the stiffness of an arm over its joint angles, with error bars, judged on runs it has not seen.

    Parameters
    ----------
    arm : the arm; where it was calibrated, the calibration's uncertainty joins the error bars
    inputs : joint coordinates to learn over; default: all that move the stiffness
    basis : "best" tries several and takes the best on unseen runs
    degree : total degree of the polynomial
    runs : model runs to fit on; default: 4096, or three for each term
    direction : of the load, base axes
    at_load_N : load at which stiffness is stated, for an arm with effects; default: as of :func:`stiffarm.map_joints`
    seed : of the random numbers

    Raises
    ------
    InputError
        A coordinate that the arm does not have, a rigid arm, or a basis that cannot be fitted.

    Examples
    --------
    >>> import stiffarm as sa
    >>> s = sa.fit(sa.load("xr701"), runs=500, basis="polynomial", degree=3)
    >>> len(s.query(q_deg={"q2_deg": 5, "q3real_deg": 77.5}).values)
    1
    """
    from stiffarm.commands.fit.learning import learning_task
    from stiffarm.session.stated import at_load
    from surrogate import inputs_that_matter, train

    arm = at_load(arm, at_load_N, direction)
    names = inputs_that_matter(arm.model, direction) if inputs is None else tuple(inputs)
    for name in names:
        require_one_of("inputs", name, arm.coordinates, code="B003")
    along = tuple(float(v) for v in np.array(direction, dtype=np.float64) / np.linalg.norm(direction))
    rng = np.random.default_rng(seed)
    with called():
        task = learning_task(arm.description, arm.model, names, rng, direction=(along[0], along[1], along[2]))
        trained = train(task, rng, basis=basis, degree=degree, runs=runs)
    return Surrogate(trained.best)


def load_surrogate(file: str | Path) -> Surrogate:
    """Read a surrogate's JSON file, as ``stiffarm fit`` and :meth:`Surrogate.save` write it.

    Raises
    ------
    InputError
        No such file, a file that is damaged, or one that is no surrogate.
    """
    from surrogate import load_surrogate as read

    with called():
        return Surrogate(read(Path(file)))
