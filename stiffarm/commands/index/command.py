"""Stiffness indices at poses: how soft the tool is at worst, along what, and which part deflects most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

import fem
from fem import compliance_budget
from fem.arm import Arm
from fem.effects.structure import joint_is_rigid
from machining import (
    INDICES,
    StiffnessEllipsoid,
    evaluate,
    limit_distance,
    singular_distance,
    softest_share,
    stiffness_ellipsoid,
    translational,
)
from robots.arrays import Array
from robots.constants import DOWN
from robots.quantities import QUANTITIES, Quantity, angle, percent, quantity, stiffness
from stiffarm.capability import capability
from stiffarm.pages.report import Fold, KeyFigure, Section, Table, Text
from stiffarm.request import (
    DIRECTION,
    FORCE,
    FRAME,
    POSE,
    TABLE,
    WRENCH,
    ByName,
    Given,
    Poses,
    Request,
    argument,
    option,
    poses_asked,
)
from stiffarm.result import Drawing, Result, plain
from stiffarm.result import Table as Values
from stiffarm.session.inputs import with_links
from stiffarm.session.stated import at_load, intervals_at, stated_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Singular values below which a pose is said to be close to a singularity.
CLOSE = 0.05
AXES = ("weakest", "middle", "stiffest")
SEMI_AXIS = stiffness("stiffness")
CAPTION = (
    "Force that it takes to move the tool by 1 mm, by the force's direction, in three planes of the base frame. Blue: "
    "1 mm in any direction; orange, dashed: 1 mm along the force itself."
)


@dataclass(frozen=True, kw_only=True)
class IndexRequest(Request):
    """Compute stiffness indices at poses, such as k_fs and NSPI.

    Also the Rayleigh quotient, directional stiffness, weakest and stiffest direction, and isotropy.

    Examples
    --------
    >>> import stiffarm as sa
    >>> found = sa.index("kr60-3", pose={"q2_deg": -60, "q3_deg": 40, "q5_deg": 40}, force=[200, 200, 200])
    >>> found["k_fs"].shape
    (1,)
    """

    poses: Poses | None = argument(
        "Table of poses (CSV/XLSX) with one column per joint coordinate, in deg.", TABLE, metavar="[POSES]"
    )
    pose: Given = option(
        "Joint coordinates in deg, as in q2_deg=5,q3_deg=77; coordinates not given are 0. May be repeated.",
        POSE,
        several=True,
    )
    normal: Sequence[float] = option("Surface normal in base axes.", DIRECTION, default=(0.0, 0.0, 1.0))
    force: Sequence[float] | None = option(
        "Force on the tool in base axes, in N; needed for NSPI and the Rayleigh quotient.", FORCE
    )
    tool: Sequence[float] | Array | None = option(
        "Tool frame on the flange, in mm and deg (a, b, c about the fixed axes x, y, z in this order); its z axis "
        "points out of the holder through the tip. Default: the model's tool.",
        FRAME,
    )
    load: ByName | None = option(
        "Load that the arm carries, in N and N m, as in fz_N=-650; adds the stiffness K_C due to the load. Default: no "
        "load.",
        WRENCH,
    )
    at_load: float | None = option(
        "Load in N at which stiffness is stated, for a model with effects that are not linear in the load, such as "
        "backlash. Default: of the loads it was calibrated with, the one nearest to the rated load.",
        metavar="N",
    )


@dataclass(frozen=True, eq=False)
class Indices:
    """Poses q (n, dof) rad with their indices by name (n,), N/m or a pure number.

    ``compliance`` (n, 3, 3) m/N at the tip; ``rigid_links``: the indices with rigid links, as the papers that propose
    them have it; None where the links are rigid anyway.
    """

    q: Array
    labels: tuple[str, ...]
    values: dict[str, Array]
    compliance: Array
    ellipsoid: StiffnessEllipsoid
    rigid_links: dict[str, Array] | None

    @property
    def softest(self) -> int:
        """The pose whose weakest direction is the softest."""
        return int(np.argmin(self.ellipsoid.semi_axes[:, 0]))


def answer(given: Arm, asked: IndexRequest) -> Result:
    """Indices at poses with intervals, the ellipsoid behind them, and what deflects most."""
    q, labels, remarks = poses_asked(given.robot, asked.pose, asked.poses, "index")
    T_tool = given.robot.T_flange_tool if asked.tool is None else np.asarray(asked.tool)
    tip, normal = T_tool[:3, 3], np.asarray(asked.normal)
    force = None if asked.force is None else np.asarray(asked.force)
    load = None if asked.load is None else np.asarray(asked.load)
    along = next((v[:3] for v in (force, load) if v is not None and v[:3].any()), DOWN)
    arm = at_load(given, asked.at_load, along, tip)

    def indices(model: fem.ArmModel) -> tuple[Array, dict[str, Array]]:
        C = translational(model, q, tip, load)
        usable = (name for name, one in INDICES.items() if force is not None or "force" not in one.uses)
        return C, {name: evaluate(name, C, normal, force) for name in usable}

    C, values = indices(arm.model)
    rigid = _joints_alone(arm)
    found = Indices(q, labels, values, C, stiffness_ellipsoid(C), None if rigid is None else indices(rigid)[1])
    near = singular_distance(arm.robot, q)
    further = dict(zip(map(angle, arm.robot.coordinates), q.T, strict=True))
    further |= {QUANTITIES["joint_limit"]: limit_distance(arm.robot, q), QUANTITIES["singularity"]: near}
    if load is not None:
        further[QUANTITIES["stiffness_share_taken_by_load"]] = softest_share(arm.model, q, load, tip)
    left_out = [name for name in INDICES if name not in values]
    remarks += [f"{name} ({INDICES[name].formula}) needs --force" for name in left_out]
    remarks += [
        f"pose {label} is close to a singularity (smallest singular value {value:.2g})"
        for label, value in zip(labels, near, strict=True)
        if value < CLOSE
    ]
    directional = QUANTITIES["directional"]
    ends = intervals_at(arm.description, arm.model, q, normal, values["directional"], tip)
    poses = {"pose": labels}
    tables = [
        Values(
            "poses",
            f"Indices of {arm.robot.name}",
            poses,
            _by_quantity(values),
            {directional: ends},
            further,
            {"compliance_mm_per_N": [[plain(row, 1e3) for row in one] for one in C]},
        ),
        _axes(found),
    ]
    if found.rigid_links is not None:
        caption = "With rigid links, as in the papers that propose these indices"
        tables.insert(1, Values("rigid_links", caption, poses, _by_quantity(found.rigid_links), folded=True))
    interval = intervals_at(
        arm.description,
        arm.model,
        q[[found.softest]],
        found.ellipsoid.axes[found.softest, :, 0],
        found.ellipsoid.semi_axes[[found.softest], 0],
        tip,
    )
    known = bool(np.isfinite(interval[0][0]))
    facts = {
        "robot": arm.robot.name,
        "tool_tip_mm": plain(tip, 1e3),
        "normal": plain(normal),
        "force_N": None if force is None else plain(force),
        "load": None if load is None else plain(load),
        "not_computed": dict.fromkeys(left_out, "needs a force"),
    } | stated_table(arm.model)
    return Result(
        name="index",
        title=f"Stiffness of the {arm.description.title.split(' (')[0]} at "
        + ("one pose" if len(q) == 1 else f"{len(q)} poses"),
        question="how stiff is it in each direction?",
        answer=_answer(found),
        how_sure="95 % intervals rest on the covariance of the model's calibration; static stiffness only."
        if known
        else "No interval: the model does not say how sure its springs are.",
        what_next=_next(found, near),
        facts=facts,
        tables=tuple(tables),
        drawings=(
            Drawing(
                "ellipsoid",
                CAPTION,
                "stiffness by direction of the force",
                partial(_ellipsoid, C, labels, normal),
            ),
        ),
        key=_key(arm, found, tip, SEMI_AXIS.between(interval[0][0], interval[1][0]) if known else ""),
        sections=(_method(facts),),
        remarks=tuple(remarks),
        arm=arm,
        found=found,
    )


def _ellipsoid(C: Array, labels: Sequence[str], normal: Array) -> Figure:
    from stiffarm.commands.index.figures import MOST_POSES, ellipsoid_figure

    return ellipsoid_figure(C[:MOST_POSES], labels[:MOST_POSES], normal)


def _by_quantity(values: dict[str, Array]) -> dict[Quantity, Array]:
    return {quantity(name): one for name, one in values.items()}


def _joints_alone(arm: Arm) -> fem.ArmModel | None:
    """The arm with rigid links; None where they are rigid anyway, or nothing would deflect without them."""
    if arm.model.link_kind == "rigid":
        return None
    model = with_links(arm, "rigid").model
    joints = not all(joint_is_rigid(joint, model.robot.dof) for joint in model.joints)
    return model if joints or model.base.any() or model.tool.any() else None


def _axes(found: Indices) -> Values:
    """Axes of the ellipsoid, three rows a pose."""
    axes, n = found.ellipsoid, len(found.q)
    directions = axes.axes.transpose(0, 2, 1).reshape(3 * n, 3)
    return Values(
        "axes",
        "Stiffness by direction: axes of the ellipsoid",
        {"pose": [label for label in found.labels for _ in AXES], "axis": list(AXES) * n},
        {SEMI_AXIS: axes.semi_axes.reshape(3 * n)}
        | {
            Quantity(name, label=f"{name} of the direction", digits=2): v
            for name, v in zip("xyz", directions.T, strict=True)
        },
        folded=True,
    )


def _direction(vector: Array) -> str:
    return ", ".join(f"{v + 0.0:.2f}" for v in vector)


def _answer(found: Indices) -> str:
    i, axes = found.softest, found.ellipsoid
    where = "" if len(found.q) == 1 else f" (pose {found.labels[i]}, the softest)"
    return (
        f"The tool deflects most along {_direction(axes.axes[i, :, 0])} in base axes{where}: "
        f"{SEMI_AXIS.text(axes.semi_axes[i, 0], unit=True)}, against "
        f"{SEMI_AXIS.text(axes.semi_axes[i, 2], unit=True)} in the stiffest direction."
    )


def _next(found: Indices, near: Array) -> str:
    if (near < CLOSE).any():
        labels = ", ".join(label for label, one in zip(found.labels, near, strict=True) if one < CLOSE)
        return f"Pose {labels} is close to a singularity: keep programs away from it. `stiffarm posture` finds others."
    if len(found.q) == 1:
        return "Compare other postures at this point with `stiffarm posture`, and other points with `stiffarm map`."
    return "Choose the pose that is stiffest along your force; index.csv lists all of them."


def _key(arm: Arm, found: Indices, tip: Array, interval: str) -> tuple[KeyFigure, ...]:
    i, axes = found.softest, found.ellipsoid
    load = np.concatenate([axes.axes[i, :, 0], np.zeros(3)])
    budget = compliance_budget(arm.model, found.q[i : i + 1], load, tip)
    part = int(budget.share[0].argmax())
    k_fs, k = QUANTITIES["k_fs"], found.values["k_fs"]
    alone = "" if found.rigid_links is None else k_fs.text(found.rigid_links["k_fs"][int(k.argmin())], unit=True)
    out = [
        KeyFigure(SEMI_AXIS.text(axes.semi_axes[i, 0], unit=True), "weakest direction", interval),
        KeyFigure(f"{budget.parts[part]}, {percent(float(budget.share[0, part]))}", "deflects most there"),
        KeyFigure(
            k_fs.text(k.min(), unit=True),
            "k_fs: least force along the normal for 1 mm in any direction",
            f"{alone} with rigid links, as its paper has it" if alone else "",
        ),
    ]
    if len(k) > 1:
        best = SEMI_AXIS.text(axes.semi_axes[:, 0].max(), unit=True)
        out.append(KeyFigure(best, "weakest direction of the stiffest pose"))
    return tuple(out)


def _method(facts: dict[str, object]) -> Section:
    said = [f"{name.replace('_', ' ')}: {facts[name]}" for name in ("tool_tip_mm", "normal", "force_N", "load")]
    formulas = tuple((name, one.formula) for name, one in INDICES.items())
    table = Fold("What each index is", (Table("Formulas", ("index", "formula"), formulas, (0, 1)),))
    return Section("How it was found", (Text("; ".join(said) + "."), table), folded=True)


index = capability("index", IndexRequest, answer)
