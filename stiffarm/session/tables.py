"""Tables for people: what the commands show on stderr."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from doe import PoseEffects
from meshes import RobotMasses
from robots import ModelDescription
from robots.schema.description import Joint
from robots.schema.quantities import RotationalStiffness
from stiffarm.session.console import say, show_table


def robot(description: ModelDescription, masses: RobotMasses) -> None:
    """Joints, limits, springs, masses and notes of one robot."""
    rows = []
    for joint in description.joint:
        low, high = np.degrees(joint.limits.si_array)
        rows.append([joint.name, joint.coordinate, f"{low:g} to {high:g}", _spring(joint)])
    show_table(f"{description.title}: joints", ["joint", "coordinate", "limits (deg)", "stiffness"], rows)
    for coupling in description.coupling:
        terms = " ".join(f"{t.factor:+g} {t.coordinate}" for t in coupling.terms)
        low, high = np.degrees(coupling.limits.si_array)
        offset = 0.0 if coupling.offset is None else np.degrees(coupling.offset.si)
        say(f"coupled limit {coupling.name}: {low:g} <= {offset:g} {terms} <= {high:g} deg ({coupling.limits.source})")
    if masses.links:
        _masses(description, masses)
    for note in description.notes:
        say(f"note: {note}")


def _masses(description: ModelDescription, masses: RobotMasses) -> None:
    """Table of masses: casings and what the file declares, up to the robot's own mass."""
    rows = [[link.name, *map(_kg, (link.casing.kg, link.rest_kg, link.declared_kg))] for link in masses.links]
    own = [] if masses.crank is None else [("bar", masses.bar_kg), ("crank", masses.crank.kg)]
    rows += [[name, _kg(mass), "", _kg(mass)] for name, mass in own]
    rows += [["all parts", "", "", _kg(masses.sum_kg)], ["the robot", "", "", _kg(masses.robot_kg)]]
    show_table(
        f"{description.title}: masses",
        ["part", "casing (kg)", "drives and the rest (kg)", "declared (kg)"],
        rows,
    )
    if own:
        say("bar and crank declare no mass: they weigh what their sections do")
    light = [link.name for link in masses.links if link.rest_kg is not None and link.rest_kg < 0.0]
    if light:
        say(f"warning: declared lighter than the casing: {', '.join(light)}")


def _kg(mass: float | None) -> str:
    return "-" if mass is None else f"{mass:.1f}"


def _spring(joint: Joint) -> str:
    if joint.stiffness is None:
        return "not given (rigid)"
    if isinstance(joint.stiffness, RotationalStiffness):
        return f"{joint.stiffness.si:.4g} N m/rad ({joint.stiffness.source})"
    return f"depends on {', '.join(joint.stiffness.inputs)}"


def sensitivity(effects: Sequence[PoseEffects], low: float, high: float, load_path: str) -> None:
    """Effect of each spring on dz, pose by pose."""
    show_table(
        f"Effect on dz (mm) of each spring from {low:g} to {high:g} N m/rad ({load_path})",
        ["pose", *effects[0].joints, "ranking"],
        [[e.pose, *(f"{v:+.3f}" for v in e.effect_mm), " > ".join(e.ranking)] for e in effects],
    )


def peers(rows: Sequence[dict[str, Any]]) -> None:
    """Other methods beside ours, on the same runs."""

    def percent(value: float | None) -> str:
        return "-" if value is None else f"{100.0 * value:.2g} %"

    show_table(
        "The same runs by other methods (errors of compliance on runs kept out)",
        ["method", "RMS", "worst", "fit, s", "1e5 queries, s", "kB"],
        [
            [r["method"], "refused", "", "", "", ""]
            if r["refused"]
            else [
                r["method"],
                percent(r["interior_rms"]),
                percent(r["interior_worst"]),
                f"{r['fit_s']:.2g}",
                f"{r['seconds_for_1e5_queries']:.2g}",
                f"{(r['bytes'] or 0) / 1e3:.3g}",
            ]
            for r in rows
        ],
    )


def surrogates(content: dict[str, Any]) -> None:
    """Held-out errors of the surrogates of a training."""
    show_table(
        f"Relative error of {content['quantity']} on runs kept out",
        ["basis", "terms", "RMS", "worst", "in 95 % bars", "cond."],
        [
            [
                f"{s['basis']} {s['degree_or_order']}",
                str(s["terms"]),
                f"{s['rms_relative_error']:.1e}",
                f"{s['max_relative_error']:.1e}",
                f"{100.0 * s['coverage_of_95_percent_bars']:.1f} %",
                f"{s['condition_number']:.0e}",
            ]
            for s in content["surrogates"]
        ],
    )
