"""Which of the arm's configurations a pose is: KUKA's S and T, ABB's confdata, VAL3's config.

All three controllers name the sides of the same three singularities of an arm with a spherical wrist. The sides come
from :func:`robots.inverse.singularities.configuration`, so that they hold for arms with an offset at the elbow too.

KUKA (System Software programming manual; the same bits are SINUMERIK's STAT). S is a number of three bits:

- bit 0: 0 in the basic area (wrist centre in front of axis 1: its x in the frame that turns with A1 is positive), 1 in
  the overhead area;
- bit 1: 0 where A3 is less than the angle at which the wrist centre lies on the line through axes 2 and 3, 1 beyond.
  Without an offset between A3 and A4 that angle is 0; with an offset a it is atan(a / length of the forearm);
- bit 2: 0 for A5 from 0 on, 1 for A5 less than 0 (each within half a turn).

T has bit i - 1 set where A_i is less than 0. Controllers ignore bits of T whose axis is within about 2 deg of 0, and S
and T of linear moves but for the first point.

ABB (RAPID reference manual, ``confdata``, serial-link robots): cf1, cf4 and cf6 are the quarter turns of axes 1, 4, 6
(0: 0 to 90 deg, 1: 90 to 180, -1: -90 to 0). cfx = 4 (wrist centre behind axis 1) + 2 (behind the lower arm) + 1 (axis
5 negative).

VAL3 (reference manual, arm configuration; public postprocessors): shoulder ``lefty`` in front and ``righty`` behind,
elbow ``epositive`` and ``enegative`` by the sign of joint 3 from the stretched arm, wrist ``wpositive`` and
``wnegative`` by the sign of joint 5.
"""

from __future__ import annotations

import numpy as np

from robots import InputError, Robot
from robots.arrays import Array, Bools, Integers
from robots.inverse.singularities import configuration
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_not_spherical

VAL3_WORDS = (("lefty", "righty"), ("epositive", "enegative"), ("wpositive", "wnegative"))


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


def kuka_status_turn(robot: Robot, q: Array, controller_deg: Array) -> Integers:
    """S and T (n, 2) of poses q (n, 6) rad with KUKA's angles A1 to A6 (n, 6) deg."""
    behind, backward, negative = sides(robot, q, controller_deg)
    status = 1 * behind + 2 * ~backward + 4 * negative
    turn = (controller_deg < 0.0) @ (1 << np.arange(6))
    return np.stack([status, turn], axis=1).astype(np.int64)


def abb_configuration(robot: Robot, q: Array, controller_deg: Array) -> Integers:
    """cf1, cf4, cf6, cfx (n, 4) of poses q (n, 6) rad with ABB's angles (n, 6) deg."""
    behind, backward, negative = sides(robot, q, controller_deg)
    quarters = np.floor(controller_deg[:, [0, 3, 5]] / 90.0)
    cfx = 4 * behind + 2 * backward + 1 * negative
    return np.column_stack([quarters, cfx]).astype(np.int64)


def val3_configuration(robot: Robot, q: Array, controller_deg: Array) -> list[tuple[str, ...]]:
    """Words for shoulder, elbow and wrist, n tuples, of poses q (n, 6) rad with Staubli's angles (n, 6) deg."""
    found = np.stack(sides(robot, q, controller_deg), axis=1).astype(int).tolist()
    return [tuple(words[i] for words, i in zip(VAL3_WORDS, row, strict=True)) for row in found]
