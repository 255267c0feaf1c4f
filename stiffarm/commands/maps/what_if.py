"""What a map's page needs to change springs by hand: the compliance as a surrogate, and the springs' intervals."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from fem import ArmModel, compliance, compliance_factor
from fem.arm import Arm
from robots import ModelDescription, content_hash, forward_kinematics
from robots.arrays import Array
from robots.robot import middle_pose
from stiffarm.pages.parts import packed
from surrogate.arm_scope import scope_of
from surrogate.designs import space_filling_design
from surrogate.factored import fit_factored
from surrogate.maps.data import MapData
from surrogate.maps.poses import last_joint_is_free
from surrogate.maps.quantities import STIFFNESS_ARRAY
from surrogate.portable import Portable, surrogate_data
from surrogate.scope import Scope

# Of a spring whose model says nothing of how sure it is: what machining takes too.
ASSUMED: Final = 0.15
# Times the spring where its interval has no upper end.
OPEN: Final = 10.0
# Poses by which it is judged whether joint 1 only turns the arm, and what is rounding there.
DRAWN: Final = 32
SAME: Final = 1e-9
# More joint coordinates than these would need thousands of terms.
MOST_INPUTS: Final = 6


def what_if_data(given: Arm, data: MapData, tool: Array | None = None) -> dict[str, Any] | None:
    """For the page: the compliance at any pose with a weight for each spring, the springs, the load's direction.

    None for a map that has no stiffness along a load, or an arm with too many joints. ``tool`` (3,) m: the tool point
    in the flange frame.
    """
    words = data.metadata.get("load_direction")
    if STIFFNESS_ARRAY not in data.fields or words is None or given.robot.dof > MOST_INPUTS:
        return None
    direction = np.array([float(v) for v in words.split()])
    model, turning = given.model, turns_with_the_first_joint(given, tool)
    portable = learned_compliance(given, tool, first=1 if turning else 0)
    return {
        "surrogate": _forces_only(portable),
        # Angle of joint 1 that the surrogate has; the page turns what it answers about that joint's axis by the rest.
        "turned": float(middle_pose(given.robot)[0]) if turning else None,
        "direction": (direction / np.linalg.norm(direction)).tolist(),
        "columns": [given.robot.coordinate_index(name) for name in portable.inputs],
        "springs": [
            {"name": name, **interval_of(name, value, given.description)} for name, value in springs_of(model, tool)
        ],
    }


def turns_with_the_first_joint(given: Arm, tool: Array | None = None) -> bool:
    """Whether joint 1 only turns the arm with its compliance about its axis, as where nothing below it gives way."""
    robot = given.robot
    low, high = robot.limits.T
    q = np.random.default_rng(0).uniform(low, high, (40 * DRAWN, robot.dof))
    q = q[robot.reachable(q)][:DRAWN]
    if not len(q):
        return False
    turned = q.copy()
    turned[:, 0] = middle_pose(robot)[0]
    by = (q - turned)[:, 0] * robot.sign[0]
    axis = forward_kinematics(robot, q).axis[:, 0]
    R = Rotation.from_rotvec(by[:, None] * axis).as_matrix()
    here, there = (compliance(given.model, poses, tool)[:, :3, :3] for poses in (q, turned))
    off = np.abs(R @ there @ R.swapaxes(1, 2) - here).max(axis=(1, 2))
    return bool((off <= SAME * np.abs(here).max(axis=(1, 2))).all())


def learned_compliance(given: Arm, tool: Array | None = None, first: int = 0) -> Portable:
    """The 6 x 6 compliance at the tool point over the joints that matter, each spring with a weight of its own.

    ``first``: number of the first joint that is an input; those before it stand in the middle of their range.
    """
    model, robot = given.model, given.robot
    frame = robot.T_flange_tool if tool is None else np.eye(4)
    if tool is not None:
        frame[:3, 3] = tool
    free = last_joint_is_free(robot, frame, lambda q: compliance_factor(model, q, tool).compliance())
    inputs = robot.coordinates[first : robot.dof - free]
    # What does not matter stands in the middle of its range.
    middle = np.degrees(middle_pose(robot))
    fixed = {name: float(middle[robot.coordinate_index(name)]) for name in robot.coordinates if name not in inputs}
    scope = scope_of(robot, content_hash(given.description), inputs, fixed_deg=fixed)
    columns = [robot.coordinate_index(name) for name in inputs]
    rng = np.random.default_rng(0)

    def full(Q: Array) -> Array:
        q = np.tile(middle_pose(robot), (len(Q), 1))
        q[:, columns] = Q
        return q

    def design(n: int) -> Array:
        return space_filling_design(scope.lower, scope.upper, n, rng, couplings=scope.couplings)

    found = fit_factored(lambda Q: compliance_factor(model, full(Q), tool), design, scope, apart=True)
    return Portable(
        **{f.name: getattr(scope, f.name) for f in fields(Scope)},
        expansion=found.basis.expansion(found.coefficients),
        link="factor",
        factor=found.factor,
        name=f"{robot.name} compliance",
        quantity="compliance",
        unit="SI",
    )


def _forces_only(portable: Portable) -> dict[str, Any]:
    """The surrogate's data without what moments do, and its numbers in single precision: a tenth of the text."""
    out = surrogate_data(portable)
    coefficients = portable.expansion.coefficients
    kept = coefficients.reshape(len(coefficients), -1, 6)[:, :, :3].reshape(len(coefficients), -1)
    out["sums"][0] |= {"coefficients": packed(kept, "<f4"), "m": kept.shape[1]}
    return out


def springs_of(model: ArmModel, tool: Array | None = None) -> list[tuple[str, float]]:
    """The springs that are one number at each pose, in the order of the weights; stiffness in the middle pose, SI."""
    found = compliance_factor(model, middle_pose(model.robot)[None], tool)
    names = [found.part[int(np.flatnonzero(found.group == g)[0])] for g in range(found.weights.shape[1])]
    return [(name, 1.0 / float(c)) for name, c in zip(names, found.weights[0], strict=True)]


def interval_of(name: str, value: float, description: ModelDescription) -> dict[str, Any]:
    """How many times its value a spring may have: ``low``, ``high``, and ``known`` by what, of 95 %."""
    table = None if description.calibration is None else description.calibration.uncertainty
    label, low, high = f"{name}.stiffness", 1.0 - ASSUMED, 1.0 + ASSUMED
    if table is None:
        return {"low": low, "high": high, "known": False}
    known = [one for one in table.undetermined if one.name == label]
    if label in table.parameters:
        estimate, *ends = table.interval95(table.parameters.index(label))
        low, high = (end / estimate for end in ends)
    elif known:
        low = 1.0 / OPEN if known[0].low is None else min(known[0].low / value, 1.0)
        high = OPEN if known[0].high is None else max(known[0].high / value, 1.0)
    ends_of_slider = {"low": max(low, 1.0 / OPEN), "high": min(high, OPEN)}
    return {**ends_of_slider, "known": label in table.parameters or bool(known)}
