"""Compensation for a calibrated arm: geometry, joint errors, its own weight and the cutting force at once.

The controller computes with the arm as designed. At its joint targets q the tool of the real arm is at
``T_real(q) + d(q)``: calibrated geometry with sag (:class:`doe.absolute.real_arm.RealArm`), and the deflection under
the cutting force at the angles that joints really have. Targets are moved until that is the programmed tool frame,
position and axes; the turn of the tool under the force is left as it is. Joint and Cartesian targets then say the same
to a controller with the designed kinematics: what the designed arm does at q. Nothing is put in between points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import fem
from doe.absolute.real_arm import RealArm
from doe.absolute.unknowns import CURVE_ORDER
from machining.cutting import Cut, StiffnessUncertainty, SurfaceError, surface_error
from machining.cutting.surface_error import cutting_deflection
from machining.programs.compensation import Acting, milling_force, ramped
from machining.programs.posting import Posted
from machining.programs.program import JointProgram, tool_in_part
from robots import InputError, Robot, forward_kinematics, jacobian
from robots.arrays import Array
from robots.frames import framed
from robots.joint_errors import where_unread

ROUNDS = 20
# Distance (m) and angle (rad) of the tool from where it is wanted, below which it is there.
THERE_m, THERE_rad = 1e-9, 1e-9
# A correction that turns a joint by more than this (rad) in one step is one of a singular posture.
LARGEST_STEP = 0.2
# Corrections that are taken unless the caller says so, m: a calibrated arm is off by millimetres.
CAP = 5e-3
# Targets, evenly along a program, at which doubt is worked out; a correction must be larger than so many standard
# deviations, or one of this size is asked for anyway.
JUDGED, SURE, LEAST_m = 200, 2.0, 5e-5
JOINTS = 6


@dataclass(frozen=True, eq=False)
class Corrected:
    """A program that is right on the calibrated arm.

    ``posted``: with moved targets; ``geometry``, ``weight``, ``force`` (n, 3) m, base axes: what the tool was off by at
    the targets as designed; ``turned`` (n,) rad: what its axes were; ``left`` (n,) m: what is left by the model;
    ``turns``: whether axes are corrected too, or left as they were for want of readings that tell them; ``place_sd`` m,
    ``turn_sd`` rad: the largest standard deviations of the tool's frame by what the calibration left open, NaN where
    the model does not say; ``between``: largest distance (m) half-way between points at feed, of joint and of straight
    motion; ``unread``: by joint, at how many targets its error curve is not identified; ``error``: the deflection under
    the force, None without one; ``rounds`` of corrections.
    """

    posted: Posted
    geometry: Array
    weight: Array
    force: Array
    turned: Array
    left: Array
    turns: bool
    place_sd: float
    turn_sd: float
    between: dict[str, float]
    unread: dict[str, int]
    error: SurfaceError | None
    rounds: int

    @property
    def moved(self) -> Array:
        """How far (n,) m the tool was off at the targets as designed."""
        return np.asarray(np.linalg.norm(self.geometry + self.weight + self.force, axis=1))


@dataclass(frozen=True, eq=False)
class _Loaded:
    """The real arm with the tool of a program and the force at its moves (n, 3) N, base axes; None: no force.

    ``ramp`` m: way beside a cut over which its deflection is taken to come and go.
    """

    arm: RealArm
    nominal: Posted
    force: Array | None
    cut: Cut | None
    ramp: float

    def deflection(self, q: Array) -> Array:
        """Deflection (n, 3) m under the force at coordinates q (n, dof) rad."""
        if self.force is None or self.cut is None:
            return np.zeros((len(q), 3))
        task, (kept, place) = self.nominal.state.task, self.nominal.state.places
        angles = self.arm.angles(q[kept])
        bent = cutting_deflection(self.arm.model, task, angles, self.force, self.cut.tool)[place]
        engaged = np.asarray(self.force.any(axis=1))[place]
        return ramped(bent, engaged, self.nominal.program.motions.points, self.ramp)


def correct(
    model: fem.ArmModel,
    arm: RealArm,
    nominal: Posted,
    *,
    cut: Cut | None = None,
    stiffness: StiffnessUncertainty | None = None,
    cap: float = CAP,
    ramp: float = 0.0,
) -> Corrected:
    """Move a program's targets so that the calibrated arm reaches what was programmed.

    Parameters
    ----------
    model : with the robot as designed, as ``nominal`` was posted with
    cut : force at the moves that mill; None: none
    cap : m; a correction that is larger is refused, for a part of it would leave a step in the path
    ramp : m of the moves beside a cut over which the correction for its force fades in and out

    Raises
    ------
    InputError
        An arm of other than six joints, a correction beyond the cap or less sure than it is large, a posture next to a
        singularity, targets beyond the joints' limits or where an error curve of few orders is not identified; as
        :func:`machining.programs.compensation.milling_force`.
    """
    program = nominal.program
    if program.robot.dof != JOINTS:
        raise InputError(
            f"compensation of {program.robot.name}", code="Q008", value=f"{program.robot.dof} joints", allowed="6"
        )
    wanted = _in_base(program, program.T_part_tool)
    acting = None if cut is None else _acting(nominal, cut)
    loaded = _Loaded(arm, nominal, None if acting is None else acting.found.force, cut, ramp)
    first = _parts(loaded, arm, program, wanted)
    length = np.linalg.norm(first[0] + first[1] + first[2], axis=1)
    if length.max(initial=0.0) > cap:
        worst = int(np.argmax(length))
        raise InputError(
            f"line {int(program.motions.line[worst])}: correction",
            code="Q008",
            value=f"{length[worst] * 1e6:.0f} um",
            allowed=f"up to {cap * 1e6:.0f} um (--cap-um)",
            remedy="check the calibrated model, tool and part frame and the force, or raise --cap-um",
        )
    place_sd, turn_sd = _doubt(arm, program, float(length.max(initial=0.0)))
    turns = not SURE * turn_sd > float(first[3].max(initial=0.0))
    if not turns:
        wanted = framed(arm.frames(program.q, program.T_flange_tool)[0], wanted[:, :3, 3])
    q, left, rounds = _reached(loaded, program, wanted)
    moved = _with_targets(nominal, q)
    task = nominal.state.task
    kept = nominal.state.places[0]
    error = (
        None
        if acting is None or cut is None
        else surface_error(model, task, program.q[kept], acting, stiffness=stiffness, tool=cut.tool)
    )
    between = _between(loaded, moved, wanted)
    return Corrected(moved, *first, left, turns, place_sd, turn_sd, between, _unread(arm, q), error, rounds)


def _doubt(arm: RealArm, program: JointProgram, largest: float) -> tuple[float, float]:
    """The largest standard deviations of the tool's place (m) and turn (rad) along a program; NaN: not said.

    Raises
    ------
    InputError
        The place is less sure than the correction, ``largest`` m, is large.
    """
    errors = arm.model.robot.errors
    if errors is None or not errors.parameters:
        return float("nan"), float("nan")
    rows = np.unique(np.linspace(0, program.n - 1, min(program.n, JUDGED)).astype(np.int64))
    place, turn = arm.doubt(program.q[rows], program.tool_at(rows))
    worst = float(place.max(initial=0.0))
    if SURE * worst > max(largest, LEAST_m):
        raise InputError(
            f"line {int(program.motions.line[rows[int(np.argmax(place))]])}: where the calibrated arm has this tool",
            code="Q008",
            value=f"known to {SURE * worst * 1e6:.0f} um (95 %), for a correction of up to {largest * 1e6:.0f} um",
            allowed="a correction that is larger than its doubt",
            remedy="calibrate on readings of a target near the tool point, or of several targets that are far apart",
        )
    return worst, float(turn.max(initial=0.0))


def _unread(arm: RealArm, q: Array) -> dict[str, int]:
    """By joint: at how many targets its error curve is not identified.

    Raises
    ------
    InputError
        Some, for curves of few orders, which run away where nothing was read.
    """
    robot = arm.model.robot
    errors = robot.errors
    unread = {} if errors is None else where_unread(errors, robot.joint_names, q)
    if errors is not None and unread and errors.sin.shape[1] < CURVE_ORDER:
        raise InputError(
            "targets at angles that were not read",
            code="Q008",
            value=", ".join(f"{n} of {j}" for j, n in unread.items()),
            allowed=f"none, for error curves of {errors.sin.shape[1]} orders: what these say there is not identified",
            remedy=f"calibrate with --free periodic (its curves of {CURVE_ORDER} orders stay at zero there), measure "
            "there, or choose another gamma",
        )
    return unread


def _acting(nominal: Posted, cut: Cut) -> Acting:
    task, kept = nominal.state.task, nominal.state.places[0]
    return Acting(milling_force(cut.force, task, nominal.program.motions.cutting[kept]))


def _in_base(program: JointProgram, T_part: Array) -> Array:
    """Frames (n, 4, 4) of the part in the base's."""
    return np.asarray(program.cell.T_base_part(program.travel, program.table) @ T_part)


def _parts(loaded: _Loaded, arm: RealArm, program: JointProgram, wanted: Array) -> tuple[Array, Array, Array, Array]:
    """What geometry, weight and force (n, 3) m move the tool by at the targets as designed, and turns (n,) rad."""
    T, q = program.T_flange_tool, program.q
    R, p = arm.frames(q, T)
    _, stiff = arm.rigid.frames(q, T)
    turn = np.linalg.norm(_turn(wanted[:, :3, :3], R), axis=1)
    return stiff - wanted[:, :3, 3], p - stiff, loaded.deflection(q), turn


def _turn(wanted: Array, R: Array) -> Array:
    """Rotation vectors (n, 3) rad, base axes, that turn R (n, 3, 3) into what is wanted."""
    return np.asarray(Rotation.from_matrix(wanted @ np.swapaxes(R, 1, 2)).as_rotvec())


def _reached(loaded: _Loaded, program: JointProgram, wanted: Array) -> tuple[Array, Array, int]:
    """Joint targets (n, 6) rad at which the real tool is where it is wanted, what is left (n,) m, and rounds."""
    T, q = program.T_flange_tool, program.q.copy()
    for rounds in range(1, ROUNDS + 1):
        R, p = loaded.arm.frames(q, T)
        off = np.hstack([wanted[:, :3, 3] - p - loaded.deflection(q), _turn(wanted[:, :3, :3], R)])
        away, turned = np.linalg.norm(off[:, :3], axis=1), np.linalg.norm(off[:, 3:], axis=1)
        if away.max(initial=0.0) < THERE_m and turned.max(initial=0.0) < THERE_rad:
            _refuse_beyond_limits(program, q)
            return q, away, rounds - 1
        q = q + _step(program, q, off, T)
    worst = int(np.argmax(away))
    raise InputError(
        f"line {int(program.motions.line[worst])}: compensation does not come to rest",
        code="Q008",
        value=f"still {away[worst] * 1e6:.3g} um away after {ROUNDS} rounds",
        allowed=f"{THERE_m * 1e6:g} um",
        remedy="keep the path away from singularities (another gamma), check the calibrated model and the force",
    )


def _step(program: JointProgram, q: Array, off: Array, T_flange_tool: Array) -> Array:
    """Steps (n, 6) rad of joints of the designed arm that move its tool by ``off`` (n, 6)."""
    J = jacobian(program.robot, q, T_flange_tool[..., :3, 3])
    step = np.asarray((np.linalg.pinv(J, rcond=1e-12) @ off[:, :, None])[:, :, 0])
    far = np.abs(step).max(axis=1, initial=0.0)
    if far.max(initial=0.0) > LARGEST_STEP:
        worst = int(np.argmax(far))
        raise InputError(
            f"line {int(program.motions.line[worst])}: posture next to a singularity",
            code="Q008",
            value=f"a correction of {np.linalg.norm(off[worst, :3]) * 1e6:.3g} um turns a joint by "
            f"{np.degrees(far[worst]):.3g} deg",
            allowed=f"up to {np.degrees(LARGEST_STEP):.3g} deg",
            remedy="choose another gamma or place the part elsewhere",
        )
    return step


def _refuse_beyond_limits(program: JointProgram, q: Array) -> None:
    out = np.flatnonzero(~program.robot.reachable(q))
    if out.size:
        raise InputError(
            f"line {int(program.motions.line[out[0]])}: moved target beyond the joints' limits",
            code="Q008",
            value="; ".join(program.robot.violations(q[out[0]])),
            remedy="choose another gamma or place the part elsewhere",
        )


def _with_targets(nominal: Posted, q: Array) -> Posted:
    """The program with other joint targets, and where the designed arm is there."""
    p = nominal.program
    T = tool_in_part(p.robot, p.cell, q, p.travel, p.table, p.T_flange_tool)
    motions = replace(p.motions, points=T[:, :3, 3], axes=-T[:, :3, 2])
    return replace(nominal, program=replace(p, q=q, T_part_tool=T, motions=motions))


def _between(loaded: _Loaded, moved: Posted, wanted: Array) -> dict[str, float]:
    """Largest distance (m) of the real tool from the programmed path half-way between points at feed."""
    p = moved.program
    if p.n < 2:
        return {"joint": 0.0, "cartesian": 0.0}
    T, feed = p.tool_at(slice(1, None)), ~p.motions.rapid[1:]
    half = 0.5 * (wanted[1:, :3, 3] + wanted[:-1, :3, 3])
    d = loaded.deflection(p.q)
    # The force comes and goes evenly along a move that enters or leaves the part.
    given = 0.5 * (d[1:] + d[:-1])
    q = 0.5 * (p.q[1:] + p.q[:-1])
    base = _in_base(p, p.T_part_tool)
    middle = framed(_half_turned(base[:-1, :3, :3], base[1:, :3, :3]), 0.5 * (base[1:, :3, 3] + base[:-1, :3, 3]))
    out = {}
    for name, at in (("joint", q), ("cartesian", designed_targets(p.robot, middle, q, T))):
        away = np.linalg.norm(loaded.arm.frames(at, T)[1] + given - half, axis=1)
        out[name] = float(away[feed].max(initial=0.0))
    return out


def _half_turned(R: Array, S: Array) -> Array:
    turn = Rotation.from_matrix(np.swapaxes(R, 1, 2) @ S).as_rotvec()
    return np.asarray(R @ Rotation.from_rotvec(0.5 * turn).as_matrix())


def designed_targets(robot: Robot, wanted: Array, near: Array, T_flange_tool: Array) -> Array:
    """Joint targets (n, 6) rad by which the designed arm has its tool at frames (n, 4, 4), next to those given."""
    q = near.copy()
    for _ in range(4):
        at = forward_kinematics(robot, q).T_flange @ T_flange_tool
        off = np.hstack([wanted[:, :3, 3] - at[:, :3, 3], _turn(wanted[:, :3, :3], at[:, :3, :3])])
        q = q + (np.linalg.pinv(jacobian(robot, q, T_flange_tool[..., :3, 3]), rcond=1e-12) @ off[:, :, None])[:, :, 0]
    return np.asarray(q)
