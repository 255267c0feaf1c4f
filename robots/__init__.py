"""What a robot is: description (TOML, URDF), units and limits, kinematics, parallelogram coupling."""

from robots.branches import BRANCHES, Branch, InverseSolutions, Reason
from robots.errors import InputError, InputErrors
from robots.inverse import inverse_kinematics, why_no_closed_form
from robots.kinematics import BodyFrames, forward_kinematics, jacobian, tool_position
from robots.library import bundled_names, content_hash, load_description, load_robot, save_description
from robots.robot import CouplingLimit, Parallelogram, Robot
from robots.schema import LoadPath, ModelDescription
from robots.singularities import SingularityDistance, branch_of, singularity_distance
from robots.turns import EquivalentPoses
from robots.urdf import Primitive, UrdfRobot, Visual, read_urdf

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
    "load_description",
    "load_robot",
    "read_urdf",
    "save_description",
    "singularity_distance",
    "tool_position",
    "why_no_closed_form",
]
