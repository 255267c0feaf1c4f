"""Whether readings scatter as much as their ``sigma_mm`` says: what is stated is checked like any other figure.

What is seen is the scatter of repeats about their means; where there are none, that of each set-up's readings about a
straight line over the load; where there is only one load, what is left by the springs that fit best, rigid to negative.
The first two hold whatever the arm lacks. Slips of the pen are cut at four times the scatter of the middle half.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from doe.certainty.doubts import LEVEL, Doubt, left_in_groups, numbered, p_words, setups
from doe.estimation.problem import problem
from doe.estimation.robust import robust_sd
from doe.tables.loaded import spring_parts
from doe.tables.measurements import Measurements
from fem import ArmModel
from robots import InputError
from robots.arrays import Array, Integers

# Beyond this factor one of them is a slip: micrometres typed as millimetres are a thousand times off.
SLIP = 30.0
# Sigmas this near to what is seen are right, however many readings say that they are not exact.
NEAR = 1.1
# Degrees of freedom from which on a scatter is seen.
FEWEST = 4
CUT = 4.0
# Seen as what springs leave, it may be the arm that lacks something.
BY_SPRINGS = "readings are missed by the best springs"


def sigma_doubt(model: ArmModel, data: Measurements, *, confirmed: bool = True) -> Doubt | None:
    """Sigmas that readings refute (two-sided chi-square test): intervals are as much too narrow or too wide.

    None where they do not, where no displacement brings a sigma, or too few readings tell.

    Raises
    ------
    InputError
        Stated and seen scatter are more than SLIP times apart, and nobody has ``confirmed`` that; or, whoever has, more
        than its square.
    """
    if np.isnan(data.sigma).all():
        return None
    p = problem(model, data, ())
    mine = np.isfinite(p.sigma) & (p.component < 3)
    if not mine.any():
        return None
    row, component, sigma, value = p.row[mine], p.component[mine], p.sigma[mine], p.value[mine]
    influence, rest = spring_parts(model, data)
    phase = np.unique([x or "" for x in data.phase], return_inverse=True)[1][row]
    line = numbered(np.column_stack([setups(p)[mine], phase]))
    one, load = 1.0 / sigma, np.linalg.norm(data.wrench[row], axis=1) / sigma
    springs = (influence[row, component] / sigma[:, None]).T
    seen: tuple[tuple[str, Integers, Array, Sequence[Array]], ...] = (
        ("repeats scatter", p.replicate[mine], value, [one]),
        ("readings of a set-up scatter about a straight line over the load", line, value, [one, load]),
        (BY_SPRINGS, np.zeros_like(line), value - rest[row, component], [*springs]),
    )
    for of, group, y, columns in seen:  # noqa: B007 - the last one stays
        left, freedom = left_in_groups(y / sigma, group, columns)
        # Where most agree to the digit it is the gauge's rounding that is seen, and nothing of the scatter.
        if FEWEST <= freedom <= np.count_nonzero(left):
            break
    else:
        return None
    scale = robust_sd(left[left != 0.0])
    square = float(np.sum(np.clip(left, -CUT * scale, CUT * scale) ** 2))
    times, stated = max(float(np.sqrt(square / freedom)), 1e-12), 1e3 * float(np.sqrt(np.mean(sigma**2)))
    said = f"sigma_mm says {stated:.3g} mm, but {of} by {times * stated:.3g} mm"
    limit = SLIP**2 if confirmed else SLIP
    if not 1.0 / limit <= times <= limit:
        raise InputError(
            f"{data.source}: {said}{' (micrometres typed as millimetres?)' if times < 1.0 else ''}",
            code="T014",
            allowed=f"a standard deviation within {limit:g} times of what the readings show",
            remedy="correct the column sigma_mm (standard deviation of one reading, mm) or leave it out, so that the "
            f"scatter is estimated{'' if confirmed else '; or confirm with --confirm-units that it is right as it is'}",
        )
    p_value = min(2.0 * min(float(chi2.sf(square, freedom)), float(chi2.cdf(square, freedom))), 1.0)
    if p_value >= LEVEL or 1.0 / NEAR <= times <= NEAR:
        return None
    wide = f"{times:.2g} times too narrow" if times > 1.0 else f"{1.0 / times:.2g} times too wide"
    words = (
        f"{'sigma_mm or the model' if of == BY_SPRINGS else 'sigma_mm'} is refuted: {said} ({p_words(p_value)} of the "
        f"chi-square test). Intervals that rest on it are about {wide}: correct the column, or leave it out"
    )
    return Doubt("sigma", words, p_value, times)
