"""Models and results beyond small displacements: what every command refuses or flags, in the same words."""

from __future__ import annotations

from typing import Any

import numpy as np

from fem import ArmModel, compliance
from fem.arm import Arm
from fem.statics.small_displacements import FLAG, LIMIT, beyond_small, refuse_beyond, worst_turns
from robots import InputError, ModelDescription, Robot
from robots.arm_class import arm_class, usual_load
from robots.arrays import Array
from robots.robot import middle_pose
from stiffarm.session.console import say


def refuse_too_soft(description: ModelDescription, model: ArmModel) -> None:
    """Refuse a model that its own usual load takes beyond small displacements at every pose: no result of it holds.

    Where it does at some poses, that is said: stiffnesses, indices and maps name no load that they would be judged by.

    Raises
    ------
    InputError
        Naming the joint that is softest for the class of arm.
    """
    load = usual_load(model.robot, description)
    turned = worst_turns(model) * load
    beyond = turned > LIMIT
    if not beyond.any():
        return
    text = f"model {description.name}: a load of {load:.3g} N takes it beyond small displacements"
    if not beyond.all():
        say(f"note: {text} at {int(beyond.sum())} of {len(beyond)} poses over its joint ranges; no result holds there")
        return
    of = arm_class(description, model.robot)
    here = np.zeros((1, model.robot.dof))
    compliance = np.array([float(joint.axial.compliance(here)[0]) for joint in model.joints])
    softest = int(np.argmax(compliance * of.low))
    raise InputError(
        f"{text} at every pose (it turns by {turned.min():.3g} rad or more; {LIMIT:g} are allowed), so none of its "
        f"results would hold; softest for its size ({of.size}): {model.joints[softest].name}, stiffness (N m/rad)",
        code="M006",
        value=f"{1.0 / max(float(compliance[softest]), 1e-300):.3g}",
        allowed=f"{of.low[softest]:.3g} to {of.high[softest]:.3g}, as arms of this size have",
        remedy="correct the model's stiffnesses (N m/rad, N/m)",
    )


def flagged(robot: Robot, displacement: Array, what: str) -> list[dict[str, Any]]:
    """The flag of each displacement (n, 6), to be merged into its row: empty where linear statics holds.

    What is flagged is counted for the user; where nothing else is left, it is refused.

    Raises
    ------
    InputError
        All are beyond small displacements.
    """
    beyond = beyond_small(robot, displacement)
    if beyond.size and beyond.all():
        refuse_beyond(robot, displacement, what)
    if beyond.any():
        say(f"note: {what}: {int(beyond.sum())} of {beyond.size} beyond small displacements, flagged; they do not hold")
    return [{FLAG: True} if odd else {} for odd in beyond.tolist()]


def require_springs(given: Arm, what: str) -> None:
    """Refuse a model in which nothing deflects, before any work is done.

    Raises
    ------
    InputError
        No link, joint, base or tool has a compliance.
    """
    if not compliance(given.model, middle_pose(given.robot)[None]).any():
        raise InputError(
            f"{what} of {given.robot.name}: nothing in this model deflects",
            code="M005",
            allowed="a model with joint springs or flexible links",
            remedy="give the joints a stiffness, or take --links beam",
        )
