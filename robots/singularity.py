"""How near a pose is to a singularity, where the arm loses a direction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robots.axis_lines import axis_lines
from robots.kinematics import jacobian
from robots.robot import Robot

Array = NDArray[np.float64]

# Of :func:`singularity`: below this joints run far for short ways. 0.02 is 3 deg from a straight wrist or
# more, at most poses 8 to 10 deg; measured on the bundled robots, of whose workspaces it takes 7 to 23 %.
NEAR_SINGULAR = 0.02


def singularity(robot: Robot, q: Array) -> Array:
    """Smallest over largest singular value (n,) of the flange's Jacobian, lengths over the arm's; 0 is singular.

    q (n, dof) rad. Without units, but not without a choice: another length would give other values.
    """
    J = jacobian(robot, q, np.zeros(3))
    J[:, :3] /= axis_lines(robot).length
    values = np.linalg.svd(J, compute_uv=False)
    return np.asarray(values[:, -1] / values[:, 0])
