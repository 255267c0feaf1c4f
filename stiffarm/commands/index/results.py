"""The step `index`: all stiffness indices at poses, with the ellipsoid behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import fem
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
from machining.stiffness.objective import shown
from robots import Robot
from robots.arrays import Array
from robots.quantities import rounded


@dataclass(frozen=True, eq=False)
class IndexQuestion:
    """Poses q (n, dof) rad, tool tip (3,) m on the flange, normal and force (N) in base axes.

    ``load`` (6,) N, N m: what the arm carries meanwhile (K_C is taken in), None for the unloaded arm.
    """

    q: Array
    labels: tuple[str, ...]
    tip: Array
    normal: Array
    force: Array | None = None
    load: Array | None = None


@dataclass(frozen=True, eq=False)
class IndexAnswer:
    """Indices by name (n,), N/m or a pure number; ``left_out``: those that need a force, where none is given.

    ``compliance`` (n, 3, 3) m/N at the tip; ``share`` (n,): part of the joint stiffness that the load takes away.
    ``joints_alone``: the same indices with rigid links, as the papers that propose them have it; None where the links
    are rigid anyway.
    """

    question: IndexQuestion
    values: dict[str, Array]
    left_out: tuple[str, ...]
    compliance: Array
    ellipsoid: StiffnessEllipsoid
    limit_rad: Array
    singular: Array
    share: Array | None
    joints_alone: dict[str, Array] | None = None


def answer(model: fem.ArmModel, question: IndexQuestion, rigid: fem.ArmModel | None = None) -> IndexAnswer:
    """All indices of :data:`machining.INDICES` that the question has the inputs for.

    ``rigid``: the same arm with rigid links, for what the papers' assumption gives beside it.

    Raises
    ------
    InputError
        As the indices; a load that the springs cannot hold.
    """
    q, load = question.q, question.load
    C = translational(model, q, question.tip, load)
    left_out = tuple(name for name, index in INDICES.items() if "force" in index.uses and question.force is None)

    def indices(C: Array) -> dict[str, Array]:
        return {name: evaluate(name, C, question.normal, question.force) for name in INDICES if name not in left_out}

    return IndexAnswer(
        question,
        indices(C),
        left_out,
        C,
        stiffness_ellipsoid(C),
        limit_distance(model.robot, q),
        singular_distance(model.robot, q),
        None if load is None else softest_share(model, q, load, question.tip),
        None if rigid is None else indices(translational(rigid, q, question.tip, load)),
    )


def payload(robot: Robot, found: IndexAnswer) -> dict[str, Any]:
    """The answer as JSON; null where an index is infinite."""
    asked = found.question
    return {
        "robot": robot.name,
        "tool_tip_mm": [rounded(v * 1e3) for v in asked.tip],
        "normal": [rounded(v) for v in asked.normal],
        "force_N": None if asked.force is None else [rounded(v) for v in asked.force],
        "load": None if asked.load is None else [rounded(v) for v in asked.load],
        "not_computed": dict.fromkeys(found.left_out, "needs --force"),
        "poses": [_pose(robot, found, i) for i in range(len(asked.q))],
    }


def rows(robot: Robot, found: IndexAnswer) -> list[dict[str, Any]]:
    """The answer as table rows, one a pose."""
    out = []
    for i, label in enumerate(found.question.labels):
        one = _pose(robot, found, i)
        alone = {f"{name}_rigid_links": v for name, v in one.get("indices_with_rigid_links", {}).items()}
        out.append({"pose": label} | one["joints_deg"] | one["indices"] | alone | one["distances"])
    return out


def cell(pose: Mapping[str, Any], name: str) -> str:
    """An index of a pose of the payload in words: in brackets with rigid links, where the links give way."""

    def short(value: float | None) -> str:
        return "infinite" if value is None else f"{value:.4g}"

    alone = pose.get("indices_with_rigid_links")
    return short(pose["indices"][name]) + ("" if alone is None else f" ({short(alone[name])})")


def alone_words(found: IndexAnswer) -> str:
    """What the brackets are; empty where there are none."""
    return "" if found.joints_alone is None else "in brackets with rigid links, as in the papers that propose them"


def _indices(values: Mapping[str, Array], i: int) -> dict[str, float | None]:
    return {shown(name).column: rounded(float(v[i]) * shown(name).factor) for name, v in values.items()}


def _pose(robot: Robot, found: IndexAnswer, i: int) -> dict[str, Any]:
    axes = found.ellipsoid
    out: dict[str, Any] = {
        "pose": found.question.labels[i],
        "joints_deg": {
            name: rounded(v, 9) for name, v in zip(robot.coordinates, np.degrees(found.question.q[i]), strict=True)
        },
        "indices": _indices(found.values, i),
        "ellipsoid": [
            {
                "stiffness_N_per_mm": rounded(float(axes.semi_axes[i, a]) * 1e-3),
                "direction": [rounded(v) for v in axes.axes[i, :, a]],
            }
            for a in range(3)
        ],
        "compliance_mm_per_N": [[rounded(v * 1e3) for v in row] for row in found.compliance[i]],
        "distances": {
            "joint_limit_deg": rounded(float(np.degrees(found.limit_rad[i]))),
            "singularity": rounded(float(found.singular[i])),
        },
    }
    if found.joints_alone is not None:
        out["indices_with_rigid_links"] = _indices(found.joints_alone, i)
    if found.share is not None:
        out["stiffness_share_taken_by_load"] = rounded(float(found.share[i]))
    return out
