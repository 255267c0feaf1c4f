"""Use: Cartesian stiffness and stiffness indices; posture, placement, toolpaths, NC programs (still to come)."""

from machining.cartesian import Blocks, blocks, cartesian_stiffness, in_axes, moved, translational
from machining.ellipsoid import StiffnessEllipsoid, ellipsoid_radius, stiffness_ellipsoid
from machining.indices import (
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
from machining.loaded import (
    complementary_stiffness,
    jacobian_derivative,
    loaded_compliance,
    softest_share,
    spring_jacobian,
)

__all__ = [
    "INDICES",
    "Blocks",
    "Index",
    "StiffnessEllipsoid",
    "average_stiffness",
    "blocks",
    "cartesian_stiffness",
    "complementary_stiffness",
    "directional_stiffness",
    "ellipsoid_radius",
    "evaluate",
    "in_axes",
    "jacobian_derivative",
    "loaded_compliance",
    "moved",
    "normal_stiffness_index",
    "nspi",
    "rayleigh_of_force",
    "rayleigh_quotient",
    "softest_share",
    "spring_jacobian",
    "stiffness_ellipsoid",
    "stiffness_index",
    "translational",
]
