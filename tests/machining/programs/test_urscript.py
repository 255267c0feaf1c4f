"""URScript: what is written is what the manual says, and corners never meet."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from program_cases import PLAIN, cell_of, program_of, rail
from refusals import refuses
from scipy.spatial.transform import Rotation

from machining.programs.formats import parse_options, round_trip, write_program
from machining.programs.program import JointProgram
from machining.programs.write_options import WriteOptions


def options(**more: Any) -> WriteOptions:
    return parse_options({"arm": PLAIN} | more, "options")


def lines_of(program: JointProgram, o: WriteOptions) -> list[str]:
    text = write_program(program, "urscript", "joint", o).texts()["part.script"]
    return text.splitlines()


def test_joints_are_radians_and_moves_have_times() -> None:
    program = program_of(n=5)
    lines = lines_of(program, options())
    assert lines[4].startswith("def part():")
    tcp = [float(v) for v in re.findall(r"-?\d+\.\d+", lines[5])]
    T = program.cell.tool.T_flange_tool
    np.testing.assert_allclose(tcp, [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_rotvec()], atol=1e-9)
    moves = [line for line in lines if "movej" in line]
    assert "a=0.5, v=0.2" in moves[0]
    angles = [[float(v) for v in re.search(r"\[(.*)\]", line)[1].split(",")] for line in moves]  # type: ignore[index]
    # Nine decimals of a radian.
    np.testing.assert_allclose(angles, program.q, atol=1e-9)
    times = [float(re.search(r"t=([\d.]+)", line)[1]) for line in moves[1:]]  # type: ignore[index]
    away = np.linalg.norm(np.diff(program.T_part_tool[:, :3, 3], axis=0), axis=1)
    speed = np.where(program.motions.rapid, 0.25, program.motions.feed)
    np.testing.assert_allclose(times, away / speed[1:], rtol=1e-6)
    assert lines[-1] == "end"


def test_corners_never_meet() -> None:
    """A move whose corner overlaps its neighbour's is skipped by the controller."""
    program = program_of(n=8)
    radii = [
        float(re.search(r"r=([\d.]+)\)", line)[1])  # type: ignore[index]
        for line in lines_of(program, options(blend_mm=1000.0))
        if "movej" in line
    ]
    away = np.linalg.norm(np.diff(program.T_part_tool[:, :3, 3], axis=0), axis=1)
    assert max(radii) > 0.0
    assert (radii[0], radii[-1]) == (0.0, 0.0)
    assert (np.add(radii[:-1], radii[1:]) < away).all()


def test_a_changed_digit_a_lost_time_and_other_motion_are_seen() -> None:
    program, o = program_of(n=5), options()
    texts = write_program(program, "urscript", "joint", o).texts()
    good = texts["part.script"]
    at = good.index("movej([") + len("movej([")
    moved = good[:at] + f"{float(good[at : good.index(',', at)]) + 1e-5:.9f}" + good[good.index(",", at) :]
    assert not round_trip(program, {"part.script": moved}, "urscript", "joint", o).within()
    slower = re.sub(r"t=([\d.]+)", lambda m: f"t={2.0 * float(m[1])}", good, count=1)
    assert round_trip(program, {"part.script": slower}, "urscript", "joint", o).pace == pytest.approx(1.0)
    for wrong, words in (
        (good.replace("movej([", "movel(p[", 1), "movej"),
        (good.replace("  movej", "  while True:\n  movej", 1), "loop"),
        (re.sub(r"t=[\d.]+, ", "", good), "no speed"),
        (good.replace(", t=", ", 0.1], t=", 1).replace("], 0.1]", ", 0.1]", 1), "7 angles"),
    ):
        refuses("Q001 Q005", words, round_trip, program, {"part.script": wrong}, "urscript", "joint", o)


def test_external_axes_and_words_of_the_language_are_refused() -> None:
    cell = cell_of(linear_axes=(rail(),))
    refuses("Q004", "no external axes", write_program, program_of(n=3, cell=cell), "urscript", "joint", options())
    refuses("Q004", "no word of a language", options, name="thread")
    refuses("F011", r"urscript\.speed_rad_s", options, urscript={"speed_rad_s": -1.0})
