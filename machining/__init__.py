"""Use: Cartesian stiffness and its indices, posture along a path, placement, programs, verification."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from machining.posture.drive import Drive, Smoothness, limit_distance, singular_distance
    from machining.posture.path import PathPosture, optimise_path
    from machining.posture.points import GammaRange, Postures, Sweep, best_of, best_postures, postures_at, sweep_gamma
    from machining.posture.posing import Posed, PostureRequest, pose_along
    from machining.posture.problem import Course
    from machining.posture.stretches import course_at
    from machining.setup import Setup
    from machining.stiffness.cartesian import Blocks, blocks, cartesian_stiffness, in_axes, moved, translational
    from machining.stiffness.ellipsoid import StiffnessEllipsoid, ellipsoid_radius, stiffness_ellipsoid
    from machining.stiffness.indices import (
        INDICES,
        Index,
        average_stiffness,
        directional_stiffness,
        evaluate,
        normal_stiffness_index,
        nspi,
        rayleigh_of_force,
        rayleigh_quotient,
        stiffness_index,
    )
    from machining.stiffness.loaded import (
        complementary_stiffness,
        jacobian_derivative,
        loaded_compliance,
        softest_share,
        spring_jacobian,
    )
    from machining.stiffness.objective import Objective
    from machining.task import Task, ToolPath, tool_path
    from machining.toolpaths.tables import read_path
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "INDICES",
    "Blocks",
    "Course",
    "Drive",
    "GammaRange",
    "Index",
    "Objective",
    "PathPosture",
    "Posed",
    "PostureRequest",
    "Postures",
    "Setup",
    "Smoothness",
    "StiffnessEllipsoid",
    "Sweep",
    "Task",
    "ToolPath",
    "average_stiffness",
    "best_of",
    "best_postures",
    "blocks",
    "cartesian_stiffness",
    "complementary_stiffness",
    "course_at",
    "directional_stiffness",
    "ellipsoid_radius",
    "evaluate",
    "in_axes",
    "jacobian_derivative",
    "limit_distance",
    "loaded_compliance",
    "moved",
    "normal_stiffness_index",
    "nspi",
    "optimise_path",
    "pose_along",
    "postures_at",
    "rayleigh_of_force",
    "rayleigh_quotient",
    "read_path",
    "singular_distance",
    "softest_share",
    "spring_jacobian",
    "stiffness_ellipsoid",
    "stiffness_index",
    "sweep_gamma",
    "tool_path",
    "translational",
]
