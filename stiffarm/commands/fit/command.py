"""The command `fit`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from fem.arm import Arm
from robots import InputError, Robot, require_one_of
from robots.constants import DOWN
from stiffarm.capability import capability
from stiffarm.commands.fit import learning
from stiffarm.commands.fit.report import fitted
from stiffarm.commands.query.command import Surrogate
from stiffarm.request import DIRECTION, FORCE, NAMES, POSE, Request, in_order, option, seed, word
from stiffarm.session.caution import uncalibrated
from stiffarm.session.stated import at_load
from surrogate import inputs_that_matter
from surrogate.portable.files import require_formats
from surrogate.training import BasisChoice


@dataclass(frozen=True, kw_only=True)
class FitRequest(Request):
    """Fit a surrogate of the stiffness over the joint angles.

    Its errors are measured on model runs that it has not seen.

    Examples
    --------
    >>> import stiffarm as sa
    >>> s = sa.fit(sa.load("xr701"), runs=500, basis="polynomial", degree=3)
    >>> len(s.query(q_deg={"q2_deg": 5, "q3real_deg": 77.5}).values)
    1
    """

    basis: BasisChoice = option(
        "Basis: polynomial, trigonometric, factored, adaptive, or best (the most accurate of these).",
        word(BasisChoice),
        default="best",
    )
    degree: int = option("Total degree of the polynomial basis.", default=6, least=1, most=12)
    order: int = option("Order of the trigonometric basis in each angle.", default=2, least=1, most=4)
    runs: int | None = option(
        "Number of model runs to fit to. Default: 4096, or three per term if that is more.", least=1, most=1_000_000
    )
    inputs: Sequence[str] | None = option(
        "Joint coordinates that the surrogate covers, separated by commas, as in q2_deg,q3real_deg. Default: all that "
        "matter.",
        NAMES,
    )
    fixed: Mapping[str, float] | Sequence[Mapping[str, float]] = option(
        "Values of the other joint coordinates in deg, as in q5_deg=30. May be repeated. Default: 0.",
        POSE,
        several=True,
    )
    direction: Sequence[float] | None = option("Load direction in base axes. Default: 0,0,-1.", DIRECTION)
    quantity: str = option(
        "Quantity to learn: stiffness (with the 6 x 6 compliance), or an index such as k_fs, weakest or isotropy.",
        default="stiffness",
    )
    normal: Sequence[float] | None = option("Surface normal in base axes, for an index that needs one.", DIRECTION)
    force: Sequence[float] | None = option("Force on the tool in base axes, in N, for an index that needs one.", FORCE)
    format: Sequence[str] | None = option(
        "Also write the surrogate in these formats, separated by commas: onnx, c, python, javascript.",
        NAMES,
    )
    matrix: bool = option(
        "With --format: write the 6 x 6 compliance instead of the compliance along the load.", default=False
    )
    at_load: float | None = option(
        "Load in N at which stiffness is stated, for a model with effects that are not linear in the load, such as "
        "backlash. Default: of the loads it was calibrated with, the one nearest to the rated load.",
        metavar="N",
    )
    seed: int = seed()

    def __post_init__(self) -> None:
        super().__post_init__()
        require_one_of("--quantity", self.quantity, learning.quantities(), code="A001", remedy="choose one of them")
        require_formats(self.format or ())
        self._refuse_conflicts()

    @property
    def writes_by(self) -> str | None:
        """A surrogate that is kept nowhere was fitted for nothing."""
        return "fit"

    @property
    def along(self) -> tuple[float, float, float]:
        """Unit vector of the load."""
        vector = np.asarray(DOWN if self.direction is None else self.direction, dtype=np.float64)
        x, y, z = (vector / np.linalg.norm(vector)).tolist()
        return x, y, z

    def _refuse_conflicts(self) -> None:
        """Refuse options that would do nothing, or fail once the fit is done."""
        stiffness = self.quantity == learning.STIFFNESS
        for name in ("normal", "force", "direction"):
            if getattr(self, name) is not None and stiffness == (name != "direction"):
                what = "of the stiffness"
                if not stiffness:
                    what = f"of {self.quantity}, which has no load direction of its own"
                raise InputError(
                    f"--{name} for a surrogate {what}",
                    code="A002",
                    value=getattr(self, name),
                    allowed="nothing",
                    remedy="leave it out",
                )
        refused: list[tuple[bool, str, str, str, str]] = [
            (
                self.matrix and self.basis not in ("best", "factored"),
                "--matrix with --basis",
                self.basis,
                "factored, best",
                "leave one out",
            ),
            (
                self.matrix and not self.format,
                "--matrix without --format",
                "none",
                "onnx, c, python, javascript",
                "add --format onnx",
            ),
            (self.matrix and not stiffness, "--matrix with --quantity", self.quantity, "stiffness", "leave one out"),
            (
                self.basis == "factored" and not stiffness,
                "--basis factored with --quantity",
                self.quantity,
                "stiffness",
                "take adaptive or best",
            ),
        ]
        for wrong, what, value, allowed, remedy in refused:
            if wrong:
                raise InputError(what, code="A002", value=value, allowed=allowed, remedy=remedy)


def answer(given: Arm, asked: FitRequest) -> Surrogate:
    """The surrogate, judged on runs that it has not seen."""
    normal, force = (None if v is None else np.asarray(v) for v in (asked.normal, asked.force))
    arm = at_load(given, asked.at_load, asked.along if force is None else force)
    names = inputs_that_matter(arm.model, asked.along)
    if asked.inputs is not None:
        for name in asked.inputs:
            require_one_of("--inputs", name, arm.robot.coordinates, code="A001", remedy="choose from these")
        names = tuple(asked.inputs)
    scalar = None
    if asked.quantity != learning.STIFFNESS:
        scalar = learning.index_quantity(arm.model, asked.quantity, normal, force)
    trained = learning.learn(
        arm.description,
        arm.model,
        names,
        asked.seed,
        basis=asked.basis,
        degree=asked.degree,
        order=asked.order,
        runs=asked.runs,
        fixed_deg=_fixed(arm.robot, names, cast("Sequence[Mapping[str, float]]", asked.fixed)),
        direction=asked.along,
        scalar=scalar,
    )
    remarks = [text for text in (uncalibrated(arm),) if text] + learning.remarks_of(trained)
    return fitted(arm, trained, remarks, asked.format or (), matrix=asked.matrix)


def _fixed(robot: Robot, inputs: tuple[str, ...], given: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Where the coordinates that are no input stand, deg; 0 if not given."""
    others = tuple(name for name in robot.coordinates if name not in inputs)
    if given and not others:
        raise InputError(
            "--fixed", code="A002", value=str(given), allowed="nothing: every coordinate is one of --inputs"
        )
    known = {name: value for one in given for name, value in one.items()}
    fixed = dict(zip(others, in_order(known, others, "--fixed", "number of degrees").tolist(), strict=True))
    for name, value in fixed.items():
        low, high = np.degrees(robot.limits[robot.coordinate_index(name)])
        if not low <= value <= high:
            raise InputError(
                f"--fixed: {name}" + ("" if name in known else ", which is not given and taken as 0"),
                code="A005",
                value=value,
                allowed=f"{low:g} to {high:g} deg",
                remedy=f"give --fixed {name}=..., or make it one of --inputs",
            )
    return fixed


fit = capability("fit", FitRequest, answer)
