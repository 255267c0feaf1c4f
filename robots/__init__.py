"""What a robot is: description (TOML, URDF), units and limits, kinematics, parallelogram coupling."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from robots.errors import InputError, InputErrors, Remark, require_at_least, require_one_of, require_positive
    from robots.inverse.branches import BRANCHES, Branch, InverseSolutions, Reason
    from robots.inverse.singularities import SingularityDistance, branch_of, singularity_distance
    from robots.inverse.solutions import inverse_kinematics, why_no_closed_form
    from robots.inverse.turns import EquivalentPoses
    from robots.kinematics import BodyFrames, forward_kinematics, jacobian, tool_position
    from robots.library.models import (
        bundled_names,
        content_hash,
        library_names,
        load_description,
        load_robot,
        save_description,
    )
    from robots.robot import CouplingLimit, Parallelogram, Robot
    from robots.schema.description import LoadPath, ModelDescription
    from robots.urdf.reading import Primitive, UrdfRobot, Visual, read_urdf
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "BRANCHES",
    "BodyFrames",
    "Branch",
    "CouplingLimit",
    "EquivalentPoses",
    "InputError",
    "InputErrors",
    "InverseSolutions",
    "LoadPath",
    "ModelDescription",
    "Parallelogram",
    "Primitive",
    "Reason",
    "Remark",
    "Robot",
    "SingularityDistance",
    "UrdfRobot",
    "Visual",
    "branch_of",
    "bundled_names",
    "content_hash",
    "forward_kinematics",
    "inverse_kinematics",
    "jacobian",
    "library_names",
    "load_description",
    "load_robot",
    "read_urdf",
    "require_at_least",
    "require_one_of",
    "require_positive",
    "save_description",
    "singularity_distance",
    "tool_position",
    "why_no_closed_form",
]
