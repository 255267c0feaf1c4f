"""Laws of a calibration: springs over their own angles, where they were read or calibrated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.calibration.run import StageResult
from doe.certainty.uncertainty import LawBand, law_band
from doe.published.pose_studies import PoseStudies, SpringPoints, fit_law
from fem.free.parameters import FreeLaw
from fem.springs import FourierBasis, PolynomialBasis, TableBasis, spring_from
from robots import Robot
from robots.arrays import Array
from robots.schema.description import LogPolynomialLaw

# Points of a grid along each of one, or of two angles.
_POINTS = {1: 181, 2: 61}
READ = "angles read"


@dataclass(frozen=True)
class LawCurve:
    """A law for drawing: the spring over its angles, and at the poses it was read or calibrated at.

    ``inputs``: the k coordinates it depends on; ``angle_deg`` (n, k) with ``band``: a grid, empty for more than two;
    ``read_deg`` (r, k) with ``read``, and what each of these points is (``origin``). Bands are NaN where none is known.
    """

    joint: str
    kind: str
    inputs: tuple[str, ...]
    angle_deg: Array
    band: LawBand
    read_deg: Array
    read: LawBand
    origin: tuple[str, ...]


def curves(s: StageResult) -> list[LawCurve]:
    """Every law that a stage has estimated, over the joints' limits."""
    return [_estimated(s, law) for law in s.laws]


def _estimated(s: StageResult, law: FreeLaw) -> LawCurve:
    e, robot = s.estimate, s.estimate.problem.free.model.robot
    columns, kind = _inputs(law)
    read = np.unique(np.round(e.problem.free.at.q[:, columns], 9), axis=0)
    angles = _grid(np.degrees(robot.limits[columns]))
    band, at_read = (law_band(e, s.certainty, law, _poses(robot, columns, one)) for one in (np.radians(angles), read))
    inputs = tuple(robot.coordinates[c] for c in columns)
    return LawCurve(law.joint, kind, inputs, angles, band, np.degrees(read), at_read, (READ,) * len(read))


def study_curves(studies: Sequence[PoseStudies], robot: Robot) -> list[LawCurve]:
    """Every law put through springs calibrated pose by pose, over the angles that it holds for.

    Bands are what would match the readings as well, each pose by itself.
    """
    out = []
    for study, joint, law in ((s, j, law) for s in studies for j, law in s.laws.items()):
        points = study.points[joint]
        centre, half = np.array(law.centre_deg), np.array(law.half_range_deg)
        angles = _grid(np.stack([centre - half, centre + half], axis=1))
        columns = [robot.coordinate_index(name) for name in law.inputs]
        at = _poses(robot, columns, np.radians(angles))
        ranges = np.stack([fit.equivalent[fit.joints.index(joint)] for fit in study.fits])
        known, read = _matching(robot, law, points, ranges, at), _of_points(points, ranges)
        kind = f"polynomial of degree {max(map(sum, law.exponents), default=0)}"
        out.append(LawCurve(joint, kind, law.inputs, angles, known, np.degrees(points.angles), read, points.origin))
    return sorted(out, key=lambda curve: robot.joint_names.index(curve.joint))


def _grid(ends: Array) -> Array:
    """Angles (n, k) between the ends (k, 2) of each; none for more than two."""
    count = _POINTS.get(len(ends), 0)
    sides = [np.linspace(low, high, count) for low, high in ends]
    return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, len(ends))


def _poses(robot: Robot, columns: Sequence[int], angles: Array) -> Array:
    """Poses (n, dof) rad with these angles (n, k), all others 0."""
    q = np.zeros((len(angles), robot.dof))
    q[:, columns] = angles
    return q


def _matching(robot: Robot, law: LogPolynomialLaw, points: SpringPoints, ranges: Array, q: Array) -> LawBand:
    """A law through points at poses q (n, dof), and how far it moves as they do within their ``ranges`` (m, 2).

    The logarithm of the law is linear in those of the points, which were matched one by one: their ways add up like
    errors. NaN where a point has no range, for nothing matched there.
    """

    def of(one: LogPolynomialLaw) -> Array:
        return -np.log(spring_from(robot, one).compliance(q))

    degree, middle = max(map(sum, law.exponents), default=0), of(law)
    squares = np.zeros((2, len(q)))
    for k, (low, high) in enumerate(ranges.tolist()):
        # A mirrored point moves with the one that it mirrors.
        moved = np.array([i % len(ranges) == k and o != "held" for i, o in enumerate(points.origin)])
        stepped = replace(points, stiffness=points.stiffness * np.where(moved, math.e, 1.0))
        share = of(fit_law(robot, stepped, degree, law.source)) - middle
        ways = share[:, None] * np.log([low / points.stiffness[k], high / points.stiffness[k]])
        squares += np.stack([np.minimum(ways, 0.0).min(axis=1) ** 2, np.maximum(ways, 0.0).max(axis=1) ** 2])
    return LawBand(np.exp(middle), np.exp(middle - np.sqrt(squares[0])), np.exp(middle + np.sqrt(squares[1])))


def _of_points(points: SpringPoints, ranges: Array) -> LawBand:
    """Points with their ranges; those that were held have none."""
    each = [ranges[i % len(ranges)] if o != "held" else [np.nan] * 2 for i, o in enumerate(points.origin)]
    return LawBand(points.stiffness, *np.array(each).T)


def _inputs(law: FreeLaw) -> tuple[list[int], str]:
    basis = law.basis
    if isinstance(basis, PolynomialBasis):
        return list(basis.columns), f"polynomial of degree {int(basis.exponents.sum(axis=1).max(initial=0))}"
    if isinstance(basis, FourierBasis):
        return [basis.column], f"Fourier series of order {basis.order}"
    assert isinstance(basis, TableBasis)  # noqa: S101 - the only other one
    return [basis.column], f"table of {basis.size} nodes"
