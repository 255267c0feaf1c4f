"""The joint covariance of a campaign's numbers: errors of earlier stages go on into what later ones find.

To first order a stage's error is ``e_s = own_s - S_s W_s^T sum_r W_r e_r``: its own, of covariance S_s, and what the
errors e_r of numbers held from earlier stages make of it through the whitened derivatives W of its readings (numbers
found in sequence, "two-step estimators": Newey & McFadden 1994, doi:10.1016/S1573-4412(05)80005-4, section 6).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from doe.estimation.calibration import Calibration, StageResult
from doe.model_file.carried_on import NOTHING, CarriedOn
from fem.elements.walls import wall_flexibilities
from fem.free.model import FreeModel
from fem.free.parameters import NamedNumbers, named_numbers
from robots.arrays import Array


def stage_covariance(found: Calibration, before: CarriedOn = NOTHING) -> tuple[tuple[str, ...], Array, bool]:
    """Names (p,) of all numbers found, the covariance (p, p) of their variables, and whether stages share readings.

    Zero for those at bounds or that no reading moves with. A number that several stages find is the last one's.
    Stages' own errors are taken as independent of one another, which they are where no reading serves two of them.
    ``before``: numbers of an earlier calibration, held by all stages; they come first.
    """
    stages = found.stages
    mine_all = tuple(dict.fromkeys(e.parameter.name for s in stages for e in s.certainty.estimates))
    own = [s.certainty.covariance for s in stages]
    if len(stages) == 1 and not before.names:
        return mine_all, own[0], False
    names, c = (*before.names, *mine_all), len(before.names)
    numbers = named_numbers(found.model, names, found.effects)
    own = [before.covariance, *own]
    total = sum(len(V) for V in own)
    errors, done, first = np.zeros((len(names), total)), np.arange(len(names)) < c, c
    errors[:c, :c] = np.eye(c)
    for s, V in zip(stages, own[1:], strict=True):
        mine = np.array([names.index(e.parameter.name) for e in s.certainty.estimates], dtype=np.intp)
        held = np.flatnonzero(done & ~np.isin(np.arange(len(names)), mine))
        error = np.zeros((len(mine), total))
        error[:, first : first + len(mine)] = np.eye(len(mine))
        if held.size:
            W = _whitened(found, s, numbers)
            error -= V @ W[:, mine].T @ (W[:, held] @ errors[held])
        errors[mine] = error
        done[mine] = True
        first += len(mine)
    return names, np.asarray(errors @ block_diag(*own) @ errors.T), _share_readings(stages)


def _whitened(found: Calibration, s: StageResult, numbers: NamedNumbers) -> Array:
    """Derivatives (m, p) of a stage's readings by all numbers at the final model, with unit covariance."""
    p = s.estimate.problem
    walls = wall_flexibilities(found.description, found.model, numbers.parameters)
    free = FreeModel(found.model, numbers.parameters, p.free.at, numbers.laws, walls, found.effects, p.free.history)
    J = free.evaluate(numbers.u)[1][p.row, p.component]
    return np.asarray(s.estimate.covariance.whiten(np.ascontiguousarray(J[:, numbers.columns])))


def _share_readings(stages: tuple[StageResult, ...]) -> bool:
    seen: set[bytes] = set()
    for s in stages:
        p = s.estimate.problem
        at = p.free.at
        # Poses are compared by their labels: an angle found in between moves the loaded poses.
        rows = np.column_stack([np.linalg.norm(at.wrench[p.row, :3], axis=1), p.value, p.component])
        keys = {p.poses[k].encode() + np.round(row, 9).tobytes() for k, row in zip(p.pose, rows, strict=True)}
        if keys & seen:
            return True
        seen |= keys
    return False
