"""How far the tool moves: at one pose under one load, or for every reading of a table beside what was measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.arm import Arm
from robots import InputError, load_description, require_positive
from stiffarm.capability import capability
from stiffarm.commands.simulate.pose import at_pose
from stiffarm.request import (
    POSE,
    READINGS,
    WRENCH,
    ByName,
    Readings,
    Request,
    argument,
    option,
    pose_of,
    readings_asked,
    wrench_of,
)
from stiffarm.result import Result

# A load of 650 N downward, as the XR701's campaign has it.
USUAL = {"fz_N": -650.0}


@dataclass(frozen=True, kw_only=True)
class SimulateRequest(Request):
    """Compute tool-point deflections at a pose or for a table.

    At one pose under one load, or for every reading of a measurement table.

    Examples
    --------
    >>> import stiffarm as sa
    >>> found = sa.simulate("xr701", pose={"q2_deg": 5, "q3real_deg": 77.5}, load={"fz_N": -650})
    >>> bool(found["dz"] < 0)
    True
    """

    data: Readings | None = argument(
        "Measurement table (CSV/XLSX). Default: the robot's bundled table.", READINGS, metavar="[DATA]"
    )
    pose: ByName | None = option(
        "Joint coordinates in deg, as in q2_deg=5,q3real_deg=77.5; coordinates not given are 0.", POSE
    )
    load: ByName | None = option(
        "With --pose: load at the tool point in base axes, in N and N m, as in fz_N=-650,mx_Nm=10. Default: fz_N=-650.",
        WRENCH,
    )
    unload_from: ByName | None = option(
        "With --pose: --load is reached by unloading from this larger load, as in fz_N=-1300.", WRENCH
    )
    rigid_joints: bool = option("Treat the joints as rigid: only the links deflect and no effect acts.", default=False)
    field: bool = option(
        "With --pose and --out: write the deformed arm (.vtu, .png) and the share of each part in the deflection.",
        default=False,
    )
    scale: float | None = option(
        "With --field: magnification of the drawn deflection; 1 is true scale. Default: automatic."
    )
    confirm_units: bool = option(
        "Accept the table although its values look like other units; use it after checking them.", default=False
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.pose is not None and self.data is not None:
            raise InputError(
                "simulate takes a pose or a measurement table, not both", code="A002", remedy="leave out --pose or DATA"
            )
        if self.field and self.pose is None:
            raise InputError(
                "--field",
                code="A003",
                value="a measurement table",
                allowed="one pose and load",
                remedy="give --pose, as in --pose q2_deg=5, and --load if it is not 650 N downward",
            )
        if not self.field and self.scale is not None:
            raise InputError("--scale: only with --field", code="A003", remedy="add --field or leave it out")
        require_positive("--scale", self.scale, code="A001", remedy="1 draws motion at its true size")
        given = {"--load": self.load, "--unload-from": self.unload_from}
        if self.pose is None and (names := [name for name, value in given.items() if value is not None]):
            why_not = "only with --pose: a measurement table has its own loads and phases"
            raise InputError(f"{', '.join(names)}: {why_not}", code="A003", remedy="leave it out")

    @property
    def writes_by(self) -> str | None:
        """The option that was given and writes files."""
        return "--field" if self.field else None

    def links(self, model: str, given: str | None) -> str | None:
        """Shells where fields are asked for, unless solids were asked for or calibrated with."""
        if not self.field:
            return given
        _require_meshed("--links with --field", given)
        calibration = load_description(model).calibration
        kind = given or (None if calibration is None else calibration.links)
        _require_meshed(f"--field: model {model} was calibrated with links", kind)
        return kind or "shell"


def _require_meshed(what: str, links: str | None) -> None:
    if links not in (None, "shell", "solid"):
        raise InputError(
            what,
            code="A001",
            value=links,
            allowed="shell or solid: only these have displacements, stresses and energies to show",
            remedy="give --links shell, or calibrate with --links shell",
        )


def answer(given: Arm, asked: SimulateRequest) -> Result:
    """Displacements with all effects of the arm, and what the reader must know of them."""
    if asked.field:
        _require_meshed("--field: links of the arm", given.model.link_kind)
    if asked.pose is None:
        from stiffarm.commands.simulate.readings import of_table

        return of_table(given, readings_asked(given, asked.data, confirm_units=asked.confirm_units), asked.rigid_joints)
    q = pose_of(given.robot, asked.pose, "--pose")
    wrench = wrench_of(USUAL, "--load") if asked.load is None else np.asarray(asked.load)
    return at_pose(given, q, wrench, asked)


simulate = capability("simulate", SimulateRequest, answer, own_effects=True)
