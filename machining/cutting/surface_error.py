"""Surface error along a path: how far the cutting force moves the tool, and what that leaves on the part.

``d = C_tt F`` at the tool point, small displacements, statics: no chatter, no forced vibration, no error of the
robot's own path, no part or fixture that gives way, no weight of the tool (it is there before the cut). The error is
``n . d`` with the surface normal n out of the part: **more than 0 leaves material standing, less than 0 cuts too
deep**.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.linalg import block_diag

import fem
from fem.statics.small_displacements import refuse_beyond
from machining.cutting.end_mill import Bending
from machining.cutting.equilibrium import Balance, Balanced, balanced
from machining.cutting.force import CuttingForce, ForceAlong, MillingForce
from machining.cutting.process_axes import weights
from machining.cutting.spread import Estimated, Uncertain, covariance, deviations, interval, samples
from machining.cutting.stiffness_uncertainty import SHARE, StiffnessUncertainty, assumed_uncertainty
from machining.stiffness.cartesian import translational
from machining.task import Task
from robots import InputError, forward_kinematics, tool_position
from robots.arrays import Array
from robots.constants import NORMAL_95
from robots.kinematics import as_poses

# Postures must put the tool on the path: this far off (m, rad) they belong to another one.
OFF_PATH, OFF_AXIS = 1e-5, 1e-4
# Random draws for the intervals of statistics: an end of a 95 % interval is then good to some 3 % of its half-width.
DRAWS = 4000
# Points whose dependence on the arm's variables is in memory at once: 30 MB with a hundred of them.
AT_ONCE = 4096

STATISTICS: Final = ("mean", "rms", "worst", "peak_to_valley")


@dataclass(frozen=True, eq=False)
class SurfaceError:
    """Surface error at n path points, SI.

    ``arc_length`` (n,) m; ``weight`` (n,): share of the path that a point stands for; ``force`` (n, 3) N and
    ``deflection`` (n, 3) m of the tool point, base axes; ``force_part`` (n, 3) N: the force in part axes; ``normal``
    (n,) m: the error, more than 0 is material left; ``tangential`` (n,) m: size of the deflection along the surface;
    ``sd`` (n,) m of the error, ``sd_stiffness`` and ``sd_force`` its parts to first order. ``form``, ``offset``,
    ``uncertain``: the error as :mod:`machining.cutting.spread` takes it. ``balance``: how depth and deflection came
    to rest, None if the force was taken at the nominal depth. ``open_change``: by how much (n,) m each parameter that
    the arm's calibration left open may change the error, beyond ``sd``. ``is_rough``: the laws or walls of the arm are
    so uncertain that ``sd``, to first order, is too small.
    """

    arc_length: Array
    weight: Array
    force: Array
    force_part: Array
    deflection: Array
    normal: Array
    tangential: Array
    sd: Array
    sd_stiffness: Array
    sd_force: Array
    form: Array
    offset: Array
    uncertain: Uncertain
    balance: Balanced | None
    open_change: Mapping[str, Array] = field(default_factory=dict)
    is_rough: bool = False

    @property
    def total(self) -> Array:
        """Size (n,) m of the whole deflection."""
        return np.asarray(np.linalg.norm(self.deflection, axis=1))

    @property
    def band(self) -> tuple[Array, Array]:
        """95 % interval (n,), (n,) m of the error at each point, as if it were normal."""
        return self.normal - NORMAL_95 * self.sd, self.normal + NORMAL_95 * self.sd

    @property
    def left_open(self) -> dict[str, float]:
        """Largest change (m) by each parameter that was left open and matters: above 1 % of the RMS error."""
        least = SHARE * self.statistics()["rms"]
        largest = {name: float(np.abs(change).max(initial=0.0)) for name, change in self.open_change.items()}
        return {name: size for name, size in largest.items() if size > least}

    def statistics(self) -> dict[str, float]:
        """The numbers of :data:`STATISTICS` along the path, m."""
        return {name: float(v) for name, v in statistics_of(self.normal, self.weight).items()}

    def covariance(self) -> Array:
        """Covariance (n, n) m^2 of the errors of all points."""
        return covariance(self.uncertain, self.form, self.form)

    def sample(self, draws: tuple[Array, Array]) -> Array:
        """Errors (count, n) m for draws of :meth:`machining.cutting.spread.Uncertain.draws`."""
        return self.offset + samples(self.form, draws)

    def estimated(self, generator: np.random.Generator, draws: int = DRAWS) -> dict[str, Estimated]:
        """The statistics with 95 % intervals, by normal draws: RMS, worst and peak-to-valley are not linear."""
        drawn = statistics_of(self.sample(self.uncertain.draws(draws, generator)), self.weight)
        return {name: Estimated(value, *interval(drawn[name])) for name, value in self.statistics().items()}


def statistics_of(error: Array, weight: Array) -> dict[str, Array]:
    """Statistics of errors (..., n) along a path.

    mean: weighted by arc length, signed; rms: root of the weighted mean square; worst: largest size; peak_to_valley:
    largest minus smallest.
    """
    return {
        "mean": error @ weight,
        "rms": np.sqrt(error**2 @ weight),
        "worst": np.abs(error).max(axis=-1),
        "peak_to_valley": np.ptp(error, axis=-1),
    }


def surface_error(
    model: fem.ArmModel,
    task: Task,
    q: Array,
    force: CuttingForce,
    *,
    stiffness: StiffnessUncertainty | None = None,
    tool: Bending | None = None,
    balance: Balance | None = None,
) -> SurfaceError:
    """Predict the surface error for given postures.

    Parameters
    ----------
    q : (n, dof) rad, one posture a path point; they must put the tool on the path
    force : :class:`machining.cutting.ConstantForce` or :class:`machining.cutting.MillingForce`
    stiffness : uncertainty of the arm, as :func:`machining.cutting.stiffness_uncertainty` finds it in the model file;
        default :func:`machining.cutting.assumed_uncertainty`, 15 % of each compliance
    tool : the tool's own bending; None: the tool is rigid beyond what the model holds
    balance : let the deflection change the radial depth (peripheral milling only); the uncertainty is then first order

    Raises
    ------
    InputError
        Postures off the path; deflections beyond small displacements; a balance of another force than
        :class:`machining.cutting.MillingForce`; else as the parts called.
    """
    q = as_poses(model.robot, q)
    _check_on_path(model, task, q)
    arm = stiffness or assumed_uncertainty(model)
    C = translational(model, q, task.tip)
    bending = None if tool is None else tool.matrices(task.axes)
    covariances = [np.zeros((1, 1)), arm.covariance]
    value, names, notes = [1.0, *arm.value], ("exact part", *arm.names), [arm.note]
    whole = C if bending is None else C + bending
    if tool is not None:
        covariances.append(np.full((1, 1), tool.relative_sd**2))
        value, names = [*value, 1.0], (*names, "tool bending")
        notes.append(f"tool bending {tool.compliance * 1e6:.3g} um/N, standard deviation {100 * tool.relative_sd:g} %")
    found = None
    if balance is not None:
        if not isinstance(force, MillingForce):
            raise InputError(
                "balance of depth and deflection", code="K006", value="a constant force", allowed="a milling force"
            )
        found = balanced(task, force, lambda f: _along(task, whole, f.force), balance)
    acting: ForceAlong = force.along(task) if found is None else found.force
    gain = np.ones(len(q)) if found is None else found.gain
    d = _moved(model, whole, acting.force)
    normal = np.einsum("na,na->n", task.normals, d)
    form, opened, is_rough = _form(model, task, q, arm, C, bending, acting)
    form = form * gain[:, None, None]
    notes.append(acting.note)
    uncertain = Uncertain(
        np.array(value),
        block_diag(*covariances),
        acting.value,
        acting.covariance,
        (*names, *acting.names),
        tuple(notes),
    )
    sd, by_stiffness, by_force = deviations(uncertain, form)
    return SurfaceError(
        arc_length=task.path.arc_length,
        weight=weights(task.path),
        force=acting.force,
        force_part=acting.force @ task.T_base_part[:3, :3],
        deflection=d,
        normal=normal,
        tangential=np.asarray(np.linalg.norm(d - normal[:, None] * task.normals, axis=1)),
        sd=sd,
        sd_stiffness=by_stiffness,
        sd_force=by_force,
        form=form,
        offset=(1.0 - gain) * normal,
        uncertain=uncertain,
        balance=found,
        open_change={name: gain * change for name, change in opened.items()},
        is_rough=is_rough,
    )


def cutting_deflection(model: fem.ArmModel, task: Task, q: Array, force: Array, tool: Bending | None = None) -> Array:
    """How far (n, 3) m a force (n, 3) N, base axes, moves the tool: as :func:`surface_error`, without its uncertainty.

    Raises
    ------
    InputError
        Deflections beyond small displacements.
    """
    C = translational(model, q, task.tip)
    return _moved(model, C if tool is None else C + tool.matrices(task.axes), force)


def _moved(model: fem.ArmModel, C: Array, force: Array) -> Array:
    d = np.einsum("nab,nb->na", C, force)
    refuse_beyond(model.robot, d, "deflection under the cutting force")
    return np.asarray(d)


def _form(
    model: fem.ArmModel,
    task: Task,
    q: Array,
    arm: StiffnessUncertainty,
    C: Array,
    bending: Array | None,
    acting: ForceAlong,
) -> tuple[Array, dict[str, Array], bool]:
    """The error's form (n, j, k), changes (n,) m by what was left open, and whether the first order does not hold.

    Some points at a time: what an arm of a hundred parameters depends on is a hundred matrices a point.
    """
    forms, changes, is_rough = [], [], False
    names: tuple[str, ...] = ()
    for start in range(0, len(q), AT_ONCE):
        rows = slice(start, start + AT_ONCE)
        found = arm.influence(model, q[rows], task.tip_at(rows))
        rest = C[rows] - np.einsum("j,njab->nab", arm.value, found.D)
        terms = [rest[:, None], found.D, *([] if bending is None else [bending[rows, None]])]
        normals, basis = task.normals[rows], acting.basis[rows]
        forms.append(np.einsum("na,njab,nkb->njk", normals, np.concatenate(terms, axis=1), basis, optimize=True))
        changes.append(np.einsum("na,nmab,nb->nm", normals, found.open_change, acting.force[rows]))
        names, is_rough = found.open_names, is_rough or bool(found.is_rough.any())
    return np.concatenate(forms), dict(zip(names, np.concatenate(changes).T, strict=True)), is_rough


def _along(task: Task, C: Array, force: Array) -> Array:
    return np.asarray(np.einsum("na,nab,nb->n", task.normals, C, force))


def _check_on_path(model: fem.ArmModel, task: Task, q: Array) -> None:
    n, robot = task.path.n, model.robot
    if len(q) != n:
        raise InputError("postures", code="K008", value=f"{len(q)} of them", allowed=f"{n}, one a path point")
    frames = forward_kinematics(robot, q)
    off = np.linalg.norm(tool_position(robot, frames, task.tip) - task.targets, axis=1)
    axis = -(frames.R_flange @ task.T_flange_tool[..., :3, 2, None])[..., 0]
    turned = np.linalg.norm(axis - task.axes, axis=1)
    bad = (off > OFF_PATH) | (turned > OFF_AXIS)
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(
            f"posture of path point {row} ({int(bad.sum())} of {n} postures)",
            code="K008",
            value=f"tool point {off[row] * 1e3:.4g} mm and tool axis {np.degrees(turned[row]):.3g} deg off",
            allowed=f"{OFF_PATH * 1e3:g} mm, {np.degrees(OFF_AXIS):.2g} deg",
            remedy="take postures of this task: the same path, part frame and tool",
        )
