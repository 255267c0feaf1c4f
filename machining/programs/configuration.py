"""On which side of its singularities a pose stands: what the configurations of all controllers are made of.

All name the sides of the same three singularities of an arm with a spherical wrist. The sides come
from :func:`robots.inverse.singularities.configuration`, so that they hold for arms with an offset at the elbow too.
"""

from __future__ import annotations

import numpy as np

from robots import InputError, Robot
from robots.arrays import Array, Bools
from robots.inverse.singularities import configuration
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_not_spherical


def sides(robot: Robot, q: Array, controller_deg: Array) -> tuple[Bools, Bools, Bools]:
    """Whether poses stand behind axis 1, with the elbow backwards, with controller axis 5 negative, (n,) each.

    ``q`` (n, 6) rad, ``controller_deg`` (n, 6) the same as the controller counts them.

    Raises
    ------
    InputError
        The robot has no spherical wrist.
    """
    why = why_not_spherical(robot)
    if why is not None:
        raise InputError(
            f"configuration of {robot.name} in a Cartesian program: {why}",
            allowed="arms with a spherical wrist",
            remedy="write the joint program",
        )
    shoulder, elbow, _ = configuration(spherical_wrist_arm(robot), robot, q)
    wrist = controller_deg[:, 4] - 360.0 * np.round(controller_deg[:, 4] / 360.0)
    return shoulder < 0.0, elbow < 0.0, wrist < 0.0
