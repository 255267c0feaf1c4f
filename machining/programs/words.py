"""Coordinates, comments and names that the writers of all languages share."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from machining.programs.job import Job, formatted
from machining.programs.source_text import SourceText
from robots.arrays import Array, Integers

Words = Callable[[slice], tuple[Array, Sequence[int]]]
Configurations = Callable[[slice], Sequence[Sequence[object]]]
Orientation = Callable[[Array], Array]

# Joints of every arm that these controllers drive.
ARM = 6


def words_of(job: Job, orientation: Orientation, digits: int) -> Words:
    """Cartesian coordinates (mm, and what ``orientation`` makes of rotations, ``digits`` each) or joint angles."""

    def cartesian(part: slice) -> tuple[Array, Sequence[int]]:
        T = job.program.T_part_tool[part]
        turned = orientation(T[:, :3, :3])
        return np.column_stack([T[:, :3, 3] * 1e3, turned]), _decimals(job, digits, turned.shape[1])

    def joint(part: slice) -> tuple[Array, Sequence[int]]:
        angles = job.angles(part)
        return angles, (job.options.decimals.angle,) * angles.shape[1]

    return cartesian if job.kind == "cartesian" else joint


def frame_words(job: Job, T: Array | None, orientation: Orientation, digits: int) -> tuple[str, ...] | None:
    """A frame (4, 4) m as text; None stays None."""
    if T is None:
        return None
    turned = orientation(T[None, :3, :3])
    values = np.column_stack([T[None, :3, 3] * 1e3, turned])
    return formatted(values, _decimals(job, digits, turned.shape[1]))[0]


def _decimals(job: Job, digits: int, k: int) -> tuple[int, ...]:
    return (job.options.decimals.length,) * 3 + (digits,) * k


def configurations_of(job: Job, rule: Callable[..., Sequence[Sequence[object]] | Integers | None]) -> Configurations:
    """Configurations of slices by a language's rule; nothing in joint programs, and where it has none."""

    def cartesian(part: slice) -> Sequence[Sequence[object]]:
        found = rule(job.program.robot, job.program.q[part], job.angles(part))
        if found is None:
            return joint(part)
        return found.tolist() if isinstance(found, np.ndarray) else found

    def joint(part: slice) -> Sequence[Sequence[object]]:
        return [()] * len(job.program.q[part])

    return cartesian if job.kind == "cartesian" else joint


def speeds_of(job: Job, unit: float) -> Callable[[slice], list[str]]:
    """Speeds as text, in units of so many m/s, to seven digits and never with an exponent."""

    def text(part: slice) -> list[str]:
        return [plain(v) for v in (job.commands.speed[part] / unit).tolist()]

    return text


def plain(value: float, digits: int = 7) -> str:
    """A positive number to so many digits, without exponent: controllers differ in what they read."""
    decimals = max(0, digits - 1 - int(np.floor(np.log10(value)))) if value > 0.0 else 0
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def part_names(job: Job, name: str) -> list[str]:
    """Names of the sub-programs."""
    return [f"{name}_{i + 1:03d}" for i in range(len(job.parts()))]


def head(job: Job) -> list[SourceText]:
    """Lines for the head of a program; texts from files among them."""
    program, motions = job.program, job.program.motions
    lines = [
        "written by stiffarm",
        f"tool path: {motions.source}",
        f"robot {program.robot.name}, cell {program.cell.name}, {job.kind} coordinates, {job.n} moves",
    ]
    lines += [f"E{i + 1}: {name}" for i, name in enumerate(external_names(job))]
    return [SourceText(line) for line in lines]


def external_names(job: Job) -> list[str]:
    """Names of the external axes with their units."""
    names = [f"{axis.name}, mm" for axis in job.program.cell.linear_axes]
    return names + ["turntable, deg"] * (job.program.cell.turntable is not None)


def common(job: Job) -> dict[str, object]:
    """What every template knows: options ``o``, ``head`` lines, ``count`` of moves, those ``after`` them, figures."""
    o = job.options
    return {
        "o": o,
        "head": head(job),
        "count": job.n,
        "cartesian": job.kind == "cartesian",
        "after": job.happenings.get(job.n, []),
        "blend_mm": plain(o.blend_mm),
        "joint_percent": plain(o.joint_percent),
        "rotation_deg_s": plain(o.rotation_deg_s),
    }
