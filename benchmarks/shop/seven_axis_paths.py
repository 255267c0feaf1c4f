"""Five arms with seven axes along a square, a circle and a line: joint travel against pinocchio's inverse kinematics.

    python benchmarks/shop/seven_axis_paths.py [--write]

Needs `pip install pin` (the oracle extra). ``--write`` writes docs/validation/seven_axis_paths.md. The oracle shares no
code with the program: damped least squares from 30 random starts at the first point, each followed from point to point.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

import fem
from benchmarks.asked import asked
from machining import Course, Objective, Task, tool_path
from machining.posture.stretches import course_at
from robots import ModelDescription, Robot, forward_kinematics
from robots.arrays import Array
from robots.urdf.reading import read_urdf

# A quarter of a turn in rad, and a turn each way, which stands for a joint without limits.
Q, WHOLE = 0.5 * np.pi, 2.0 * np.pi
Z, Y, MINUS_Y = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
# Of each joint: origin xyz (m) and rpy (rad) in the body before, axis, limits (rad).
Row = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float], tuple[float, float]]
NONE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SevenAxisArm:
    """An arm: its joints, its flange (xyz, rpy), where the numbers are from, and where a part is put before it (m)."""

    name: str
    source: str
    licence: str
    joints: tuple[Row, ...]
    flange: tuple[tuple[float, float, float], tuple[float, float, float]]
    part: tuple[float, float, float]

    def urdf(self) -> str:
        """The arm as URDF, for this program and for others."""
        links = "".join(f'<link name="b{i}"/>' for i in range(len(self.joints) + 1)) + '<link name="flange"/>'
        rows = [
            f'<joint name="joint_{i + 1}" type="revolute"><parent link="b{i}"/><child link="b{i + 1}"/>'
            f"{_origin(xyz, rpy)}<axis xyz={_text(axis)}/>"
            f'<limit lower="{low!r}" upper="{high!r}" effort="100" velocity="2"/></joint>'
            for i, (xyz, rpy, axis, (low, high)) in enumerate(self.joints)
        ]
        plate = f'<joint name="plate" type="fixed"><parent link="b{len(rows)}"/><child link="flange"/>'
        return f'<robot name="{self.name}">{links}{"".join(rows)}{plate}{_origin(*self.flange)}</joint></robot>\n'

    def description(self, folder: Path) -> ModelDescription:
        """The arm as this program reads it."""
        path = folder / f"{self.name}.urdf"
        path.write_text(self.urdf(), encoding="utf-8")
        return read_urdf(path).description


def _text(values: tuple[float, float, float]) -> str:
    return '"' + " ".join(repr(float(v)) for v in values) + '"'


def _origin(xyz: tuple[float, float, float], rpy: tuple[float, float, float]) -> str:
    return f"<origin xyz={_text(xyz)} rpy={_text(rpy)}/>"


def _degrees(*limits: float) -> list[tuple[float, float]]:
    return [(-float(np.radians(limit)), float(np.radians(limit))) for limit in limits]


_IIWA = _degrees(170, 120, 170, 120, 170, 120, 175)

ARMS = (
    SevenAxisArm(
        "fr3",
        "frankaemika/franka_description, robots/fr3/kinematics.yaml and joint_limits.yaml, 2024",
        "Apache-2.0",
        (
            ((0, 0, 0.333), NONE, Z, (-2.7437, 2.7437)),
            (NONE, (-Q, 0, 0), Z, (-1.7837, 1.7837)),
            ((0, -0.316, 0), (Q, 0, 0), Z, (-2.9007, 2.9007)),
            ((0.0825, 0, 0), (Q, 0, 0), Z, (-3.0421, -0.1518)),
            ((-0.0825, 0.384, 0), (-Q, 0, 0), Z, (-2.8065, 2.8065)),
            (NONE, (Q, 0, 0), Z, (0.5445, 4.5169)),
            ((0.088, 0, 0), (Q, 0, 0), Z, (-3.0159, 3.0159)),
        ),
        ((0, 0, 0.107), NONE),
        (0.45, 0.0, 0.15),
    ),
    SevenAxisArm(
        "iiwa14",
        "lbr-stack/lbr_fri_ros2_stack, lbr_description/urdf/iiwa14/iiwa14_description.xacro and joint_limits.yaml",
        "Apache-2.0",
        (
            ((0, 0, 0.1475), NONE, Z, _IIWA[0]),
            ((0, -0.01, 0.2125), NONE, Y, _IIWA[1]),
            ((0, 0.01, 0.228), NONE, Z, _IIWA[2]),
            ((0, 0.0105, 0.192), NONE, MINUS_Y, _IIWA[3]),
            ((0, -0.0105, 0.2075), NONE, Z, _IIWA[4]),
            ((0, -0.0707, 0.1925), NONE, Y, _IIWA[5]),
            ((0, 0.0707, 0.091), NONE, Z, _IIWA[6]),
        ),
        ((0, 0, 0.035), NONE),
        (0.56, 0.0, 0.2),
    ),
    SevenAxisArm(
        "gen3",
        "Kinovarobotics/ros2_kortex, kortex_description/arms/gen3/7dof/urdf/gen3_macro.xacro",
        "BSD-3-Clause",
        (
            ((0, 0, 0.15643), (2 * Q, 0, 0), Z, (-WHOLE, WHOLE)),
            ((0, 0.005375, -0.12838), (Q, 0, 0), Z, (-2.24, 2.24)),
            ((0, -0.21038, -0.006375), (-Q, 0, 0), Z, (-WHOLE, WHOLE)),
            ((0, 0.006375, -0.21038), (Q, 0, 0), Z, (-2.57, 2.57)),
            ((0, -0.20843, -0.006375), (-Q, 0, 0), Z, (-WHOLE, WHOLE)),
            ((0, 0.00017505, -0.10593), (Q, 0, 0), Z, (-2.09, 2.09)),
            ((0, -0.10593, -0.00017505), (-Q, 0, 0), Z, (-WHOLE, WHOLE)),
        ),
        ((0, 0, -0.061525), (2 * Q, 0, 0)),
        (0.4, 0.0, 0.15),
    ),
    SevenAxisArm(
        "xarm7",
        "xArm-Developer/xarm_ros2, xarm_description/urdf/xarm7/xarm7.urdf.xacro",
        "BSD-3-Clause",
        (
            ((0, 0, 0.267), NONE, Z, (-WHOLE, WHOLE)),
            (NONE, (-Q, 0, 0), Z, (-2.059, 2.0944)),
            ((0, -0.293, 0), (Q, 0, 0), Z, (-WHOLE, WHOLE)),
            ((0.0525, 0, 0), (Q, 0, 0), Z, (-0.19198, 3.927)),
            ((0.0775, -0.3425, 0), (Q, 0, 0), Z, (-WHOLE, WHOLE)),
            (NONE, (Q, 0, 0), Z, (-1.69297, 2 * Q)),
            ((0.076, 0.097, 0), (-Q, 0, 0), Z, (-WHOLE, WHOLE)),
        ),
        (NONE, NONE),
        (0.4, 0.0, 0.15),
    ),
    SevenAxisArm(
        "sawyer",
        "RethinkRobotics/sawyer_robot, sawyer_description/urdf/sawyer_base.urdf.xacro",
        "Apache-2.0",
        (
            ((0, 0, 0.08), NONE, Z, (-3.0503, 3.0503)),
            ((0.081, 0.05, 0.237), (-Q, Q, 0), Z, (-3.8095, 2.2736)),
            ((0, -0.14, 0.1425), (Q, 0, 0), Z, (-3.0426, 3.0426)),
            ((0, -0.042, 0.26), (-Q, 0, 0), Z, (-3.0439, 3.0439)),
            ((0, -0.125, -0.1265), (Q, 0, 0), Z, (-2.9761, 2.9761)),
            ((0, 0.031, 0.275), (-Q, 0, 0), Z, (-2.9761, 2.9761)),
            ((0, -0.11, 0.1053), (-Q, -0.17453, 3.1416), Z, (-4.7124, 4.7124)),
        ),
        ((0, 0, 0.0245), (0, 0, 1.570796)),
        (0.6, 0.0, 0.1),
    ),
)


PAGE = Path(__file__).resolve().parents[2] / "docs" / "validation" / "seven_axis_paths.md"
STEP, TOOL_M, STARTS = 1e-3, 0.1, 30
# Feed of all paths, m/s.
FEED = 1.0 / 60.0


def square(size: tuple[float, float] = (0.06, 0.04)) -> Array:
    """Corners (5, 2) m."""
    x, y = size
    return np.array([[0.0, 0.0], [x, 0.0], [x, y], [0.0, y], [0.0, 0.0]])


def circle(radius: float = 0.05) -> Array:
    """Points (k, 2) m of a whole circle."""
    turn = np.linspace(0.0, 2.0 * np.pi, 1 + round(2.0 * np.pi * radius / STEP))
    return radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


PATHS: dict[str, Array] = {"square": square(), "circle": circle(), "line": np.array([[-0.1, -0.05], [0.1, 0.05]])}


def dense(corners: Array) -> Array:
    """Points (n, 3) m, at most a step apart."""
    out = [corners[:1]]
    for a, b in pairwise(corners):
        pieces = max(1, round(float(np.linalg.norm(b - a)) / STEP))
        out.append(a + np.linspace(0.0, 1.0, pieces + 1)[1:, None] * (b - a))
    flat = np.concatenate(out)
    return np.column_stack([flat, np.zeros(len(flat))])


def task_of(arm: SevenAxisArm, corners: Array) -> Task:
    """The path before the arm, the tool straight down."""
    tool, part = np.eye(4), np.eye(4)
    tool[2, 3] = TOOL_M
    part[:3, 3] = arm.part
    return Task(tool_path(dense(corners), [0.0, 0.0, 1.0], feed=FEED), tool, part)


@dataclass(frozen=True, eq=False)
class Figures:
    """A course: joint travel in all, largest step, room to limits (rad), and largest miss of a frame (m, rad)."""

    travel: float
    step: float
    miss: float
    room: float

    @classmethod
    def of(cls, robot: Robot, task: Task, course: Course) -> Figures:
        """From the postures alone."""
        q, dq = course.q, np.abs(np.diff(course.q, axis=0))
        wanted = task.tool_frames(course.gamma[:, None])[:, 0]
        reached = forward_kinematics(robot, q).T_flange @ task.T_flange_tool
        room = np.minimum(q - robot.limits[:, 0], robot.limits[:, 1] - q).min()
        return cls(float(dq.sum()), float(dq.max()), float(np.abs(reached - wanted).max()), float(room))


def rigid(description: ModelDescription) -> fem.ArmModel:
    """The arm with one stiffness for all joints, which prefers none."""
    model = fem.build_model(description)
    return model.with_springs(dict.fromkeys(model.robot.joint_names, 1e6))


def pinocchio_travels(arm: SevenAxisArm, T_base_flange: Array, limits: Array) -> list[float]:
    """Joint travel (rad) of each start from which pinocchio follows flange frames (n, 4, 4) within the limits."""
    import pinocchio as pin

    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(arm.urdf())
        file.flush()
        model = pin.buildModelFromUrdf(file.name)
    data, frame = model.createData(), model.getFrameId("flange")
    lower, upper = limits.T
    targets = [pin.SE3(T[:3, :3], T[:3, 3]) for T in T_base_flange]

    def to(q: Array, target: object, rounds: int) -> Array | None:
        for _ in range(rounds):
            pin.forwardKinematics(model, data, q)
            pin.updateFramePlacement(model, data, frame)
            away = data.oMf[frame].actInv(target)
            error = pin.log(away).vector
            if np.linalg.norm(error) < 1e-9:
                return q if ((q >= lower) & (q <= upper)).all() else None
            J = pin.computeFrameJacobian(model, data, q, frame)
            J = -pin.Jlog6(away.inverse()) @ J
            q = q - J.T @ np.linalg.solve(J @ J.T + 1e-10 * np.eye(6), error)
        return None

    rng = np.random.default_rng(0)
    found = []
    for _ in range(STARTS):
        q = to(rng.uniform(np.maximum(lower, -np.pi), np.minimum(upper, np.pi)), targets[0], 500)
        if q is None:
            continue
        course: list[Array] = [q]
        for target in targets[1:]:
            new = to(course[-1], target, 50)
            if new is None or np.abs(new - course[-1]).max() > np.radians(20.0):
                break
            course.append(new)
        else:
            found.append(float(np.abs(np.diff(np.array(course), axis=0)).sum()))
    return found


def compared(arm: SevenAxisArm, name: str, corners: Array, oracle: Callable[..., list[float]]) -> tuple[str, ...]:
    """A row of the table."""
    with tempfile.TemporaryDirectory() as folder:
        model = rigid(arm.description(Path(folder)))
    task, robot = task_of(arm, corners), model.robot
    begun = time.perf_counter()
    course = course_at(model, task, 0.0, Objective(), generator=np.random.default_rng(0))
    spent = time.perf_counter() - begun
    ours = Figures.of(robot, task, course)
    flange = task.tool_frames(np.zeros(1))[:, 0] @ np.linalg.inv(task.T_flange_tool)
    theirs = oracle(arm, flange, robot.limits)
    best = min(theirs, default=np.nan)
    return (
        arm.name,
        name,
        str(task.path.n),
        f"{np.degrees(ours.travel):.1f}",
        f"{np.degrees(best):.1f}",
        f"{len(theirs)} of {STARTS}",
        f"{ours.travel / best:.2f}",
        f"{np.degrees(ours.step):.2f}",
        f"{ours.miss:.1e}",
        f"{np.degrees(ours.room):.1f}",
        f"{spent:.1f}",
    )


HEAD = (
    "arm",
    "path",
    "points",
    "travel, deg",
    "best of pinocchio, deg",
    "its starts that follow",
    "ratio",
    "largest step, deg",
    "largest miss, m or rad",
    "room to limits, deg",
    "s",
)


def main() -> None:
    """Compare, print, and write the page if given to."""
    given = asked(__doc__, write=False, arm=str)
    rows = []
    for arm in ARMS:
        if given.arm in (None, arm.name):
            for name, corners in PATHS.items():
                rows.append(compared(arm, name, corners, pinocchio_travels))
                print(" | ".join(rows[-1]), flush=True)
    if given.write:
        PAGE.write_text(page(rows), encoding="utf-8")


def page(rows: list[tuple[str, ...]]) -> str:
    """The page of the figures."""
    table = [HEAD, tuple("---" for _ in HEAD), *rows]
    sources = "\n".join(f"- {arm.name}: {arm.source} ({arm.licence})." for arm in ARMS)
    return f"""# Seven axes along paths

Written by `python benchmarks/shop/seven_axis_paths.py --write`. Five arms with seven axes follow a square of
60 x 40 mm, a circle and a line, a point every millimetre, tool straight down, gamma 0. Travel is that of all joints
together. The other column is the least that pinocchio's inverse kinematics needs, of 30 random starts, each followed
from point to point. Our course also weighs room to limits and singularities and an elbow on top, so it may travel
more; the aim is at most twice as much. Times are of a shared machine.

{chr(10).join("| " + " | ".join(row) + " |" for row in table)}

Kinematics, as plain numbers in `benchmarks/shop/seven_axis_paths.py`:

{sources}
"""


if __name__ == "__main__":
    main()
