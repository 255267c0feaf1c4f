"""One program over several tools: each move's frame by its own tool, in every language; what is planted is found."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from program_cases import PLAIN
from refusals import refuses

import fem
from machining.cell import Body, Cell, Fixture, Tool, arm_of, box, cylinder
from machining.posture.points import GammaRange, sweep_gamma
from machining.programs.formats import FORMATS, NEUTRAL, parse_options, round_trip, write_program
from machining.programs.posting import PostSettings, post
from machining.programs.program import JointProgram
from machining.setup import Setup
from machining.stiffness.objective import Objective
from machining.task import Task, tool_path
from machining.toolpaths import read_toolpath
from machining.toolpaths.conversion import read_given_path
from machining.toolpaths.motions import Motions
from machining.toolpaths.motions import Tool as Named
from machining.verification import verify
from robots import forward_kinematics
from robots.arrays import Array
from robots.frames import by_frame, framed, rotation_rpy

NX = """TOOL PATH/FACE,TOOL,MILL
UNITS/MM
LOADTL/1
SPINDL/RPM,4000,CLW
RAPID
GOTO/0,0,40,0,0,1
FEDRAT/MMPM,600
GOTO/0,0,0
GOTO/60,0,0
RAPID
GOTO/60,0,40
TOOL PATH/LEAN,TOOL,LONG
LOADTL/7
SPINDL/RPM,3000,CLW
RAPID
GOTO/60,20,40,0.2588190,0,0.9659258
FEDRAT/MMPM,300
GOTO/60,20,0,0.2588190,0,0.9659258
GOTO/0,20,0
RAPID
GOTO/0,20,40
SPINDL/OFF
END-OF-PATH
"""


def on_flange(length: float) -> Array:
    """A tool across the flange, z out of the holder, ``length`` m from the flange's axis."""
    return framed(rotation_rpy(np.array([0.0, 0.5 * np.pi, 0.0])), np.array([length, 0.0, 0.08]))


def tool(number: int, length: float, name: str = "") -> Tool:
    """A mill whose cutter reaches from the spindle's nose to its tip."""
    spindle = Body("spindle", (cylinder(0.05, 0.15).moved(on_flange(0.15) @ FLIPPED),))
    mill = Body("mill", (cylinder(0.005, length - 0.15).moved(on_flange(length) @ FLIPPED),))
    return Tool(on_flange(length), (spindle,), (mill,), number, name)


FLIPPED = framed(rotation_rpy(np.array([np.pi, 0.0, 0.0])), np.zeros(3))
PART = framed(np.eye(3), np.array([1.2, 0.0, 0.7]))


@pytest.fixture
def motions(tmp_path: Path) -> Motions:
    file = tmp_path / "part.cls"
    file.write_text(NX)
    return read_toolpath(file)


def cell_of(*tools: Tool, **more: object) -> Cell:
    return Cell(T_world_part0=PART, tools=tools or (tool(1, 0.2), tool(7, 0.26)), **more)  # type: ignore[arg-type]


def posted(kr60: fem.ArmModel, motions: Motions, cell: Cell | None = None, **more: object) -> JointProgram:
    settings = PostSettings(gamma=GammaRange(count=36), **more)  # type: ignore[arg-type]
    return post(kr60, cell or cell_of(), motions, settings).program


def frames_by_hand(program: JointProgram, tips: list[Array]) -> Array:
    """Tool frames in the part, move by move."""
    T = forward_kinematics(program.robot, program.q).T_flange
    return np.stack([np.linalg.inv(PART) @ T[i] @ tips[k] for i, k in enumerate(program.motions.tool)])


def test_each_move_has_its_own_tool_where_the_path_has_it(kr60: fem.ArmModel, motions: Motions) -> None:
    program = posted(kr60, motions)
    T = frames_by_hand(program, [on_flange(0.2), on_flange(0.26)])
    np.testing.assert_allclose(T[:, :3, 3], program.motions.points, atol=1e-9)
    np.testing.assert_allclose(T[:, :3, 2], -program.motions.axes, atol=1e-9)
    np.testing.assert_allclose(program.reached(), T, atol=1e-12)
    # With the tools exchanged the tips are elsewhere: the test can fail.
    other = frames_by_hand(program, [on_flange(0.26), on_flange(0.2)])
    assert np.linalg.norm(other[:, :3, 3] - program.motions.points, axis=1).min() > 0.05


def test_the_way_from_the_changer_is_a_joint_move_and_no_point_is_put_in(kr60: fem.ArmModel, motions: Motions) -> None:
    program = posted(kr60, motions)
    change = np.flatnonzero(program.motions.changes)
    assert len(change) == 1
    assert not program.inserted[change[0]]
    job = FORMATS["krl"].write(program, "cartesian", parse_options({}, "options"), None)
    text = job.texts()["part_001.src"]
    behind = text[text.index("tool 7") :]
    assert re.search(r"(LIN|PTP) \{", behind).group(1) == "PTP"  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("krl", "cartesian"),
        ("krl", "joint"),
        ("rapid", "cartesian"),
        ("val3", "joint"),
        ("val3", "cartesian"),
        ("sinumerik", "joint"),
        ("urscript", "joint"),
        ("json", "joint"),
        ("csv", "joint"),
    ],
)
def test_every_language_comes_back(kr60: fem.ArmModel, motions: Motions, name: str, kind: str) -> None:
    program = posted(kr60, motions)
    options = parse_options({"arm": PLAIN} if name in ("rapid", "val3", "urscript") else {}, "options")
    texts = write_program(program, name, kind, options).texts()  # type: ignore[arg-type]
    trip = round_trip(program, texts, name, kind, options)  # type: ignore[arg-type]
    assert trip.difference() is None


@pytest.mark.parametrize(
    ("name", "kind", "change"),
    [
        ("krl", "cartesian", lambda text: re.sub(r"(tool 7.*\n\$TOOL = \{X )-?[\d.]+", r"\g<1>-200.00000", text)),
        ("rapid", "cartesian", lambda text: text.replace("tCutter_7", "tCutter_1")),
        ("val3", "joint", lambda text: text.replace("tCutter[1]", "tCutter[0]")),
        ("urscript", "joint", lambda text: re.sub(r"(tool 7.*\n  set_tcp\(p\[)[-\d.]+", r"\g<1>0.200000000", text)),
    ],
)
def test_another_tools_frame_is_found(
    kr60: fem.ArmModel, motions: Motions, name: str, kind: str, change: object
) -> None:
    program = posted(kr60, motions)
    options = parse_options({} if name == "krl" else {"arm": PLAIN}, "options")
    texts = write_program(program, name, kind, options).texts()  # type: ignore[arg-type]
    spoilt = {
        file: change(text) if file.endswith((".src", ".mod", ".pgx", ".script")) else text  # type: ignore[operator]
        for file, text in texts.items()
    }
    assert spoilt != texts
    wrong = round_trip(program, spoilt, name, kind, options).difference()  # type: ignore[arg-type]
    assert wrong is not None
    assert "frame" in wrong.what


def test_neutral_programs_are_read_with_the_cells_tools(kr60: fem.ArmModel, motions: Motions) -> None:
    program = posted(kr60, motions)
    for suffix, name in ((".json", "json"), (".csv", "csv")):
        text = write_program(program, name).files[0].text()
        back = NEUTRAL[suffix].program(text, program.robot, program.cell)
        np.testing.assert_allclose(back.reached(), program.T_part_tool, atol=1e-9)


def test_a_tool_that_the_cell_lacks_is_named_with_its_line(kr60: fem.ArmModel, motions: Motions) -> None:
    refuses(
        "K003",
        r"line 16: .*tool number 7 for 'LEAN'.*\[tools.1\].*add \[tools.7\]",
        posted,
        kr60,
        motions,
        cell_of(tool(1, 0.2)),
    )
    refuses(
        "K003",
        r"uses 2 tools.*\[tools.NUMBER\], or choose",
        posted,
        kr60,
        motions,
        Cell(T_world_part0=PART, tool=tool(1, 0.2)),
    )


def test_a_path_without_tools_needs_one_on_the_flange(kr60: fem.ArmModel, motions: Motions) -> None:
    """Else its points would be reached with the flange itself, and nobody would notice."""
    bare = replace(motions, tools=(Named(),), tool=np.zeros(motions.n, dtype=np.int64), events=())
    refuses("K003", r"part.cls names no tool.*add \[tool\]", posted, kr60, bare)
    program = posted(kr60, bare, replace(cell_of(), tool=tool(9, 0.2)))
    np.testing.assert_allclose(program.T_flange_tool, on_flange(0.2))


def test_a_path_that_names_tools_takes_their_numbers_from_the_cell(kr60: fem.ArmModel, motions: Motions) -> None:
    named = replace(motions, tools=tuple(replace(one, number=None) for one in motions.tools))
    program = posted(kr60, named, cell_of(tool(4, 0.2, "mill"), tool(5, 0.26, "Long")))
    assert [one.number for one in program.motions.tools] == [4, 5]


def test_each_move_is_checked_with_the_bodies_of_its_tool(kr60: fem.ArmModel, motions: Motions) -> None:
    """As if the cell had that tool alone; and the two differ, so that the wrong bodies would be seen."""
    thing = Body("thing", (box(np.full(3, 0.05)).moved(framed(np.eye(3), PART[:3, 3] + [0.03, 0.08, -0.05])),))
    program = posted(kr60, motions, cell_of(fixtures=(Fixture(thing),)))
    arm = arm_of("kr60-3")
    whole = verify(program, arm)
    distances = []
    for i, one in enumerate(program.cell.tools):
        alone = verify(replace(program, cell=replace(program.cell, tools=(), tool=one)), arm)
        mine = program.motions.tool == i
        np.testing.assert_allclose(whole.swept.distance[mine], alone.swept.distance[mine], atol=1e-12)
        assert [whole.swept.names[k] for k in whole.swept.pair[mine]] == [
            alone.swept.names[k] for k in alone.swept.pair[mine]
        ]
        distances.append(alone.swept.distance)
    assert np.abs(distances[0] - distances[1]).max() > 0.01


def test_stiffness_along_the_path_is_that_with_each_tool(kr60: fem.ArmModel, motions: Motions, tmp_path: Path) -> None:
    given = read_given_path(tmp_path / "part.cls")
    task = Setup(cell_of()).task(given)
    assert task.T_flange_tool.shape == (given.path.n, 4, 4)
    gamma = np.linspace(-np.pi, np.pi, 24, endpoint=False)
    whole = sweep_gamma(kr60, task, Objective(), gamma)
    assert whole.valid.any()
    for rows, T in by_frame(task.T_flange_tool, given.path.n):
        p = given.path
        alone = Task(tool_path(p.points[rows], p.normals[rows], p.axes[rows]), T, task.T_base_part, task.reference)
        part = sweep_gamma(kr60, alone, Objective(), gamma)
        np.testing.assert_array_equal(whole.valid[rows], part.valid)
        np.testing.assert_allclose(whole.value[rows], part.value, rtol=1e-12)
        np.testing.assert_allclose(whole.q[rows], part.q, atol=1e-12)
