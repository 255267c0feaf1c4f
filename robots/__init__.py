"""What a robot is: description (TOML, URDF), units and limits, kinematics, parallelogram coupling."""

from robots.errors import InputError, InputErrors
from robots.kinematics import BodyFrames, forward_kinematics, jacobian, tool_position
from robots.library import bundled_names, content_hash, load_description, load_robot, save_description
from robots.robot import CouplingLimit, Parallelogram, Robot
from robots.schema import LoadPath, ModelDescription
from robots.urdf import Primitive, UrdfRobot, Visual, read_urdf

__all__ = [
    "BodyFrames",
    "CouplingLimit",
    "InputError",
    "InputErrors",
    "LoadPath",
    "ModelDescription",
    "Parallelogram",
    "Primitive",
    "Robot",
    "UrdfRobot",
    "Visual",
    "bundled_names",
    "content_hash",
    "forward_kinematics",
    "jacobian",
    "load_description",
    "load_robot",
    "read_urdf",
    "save_description",
    "tool_position",
]
