"""Frames of the cell: linear axes carry the robot, the turntable carries the part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses
from rigid_frames import rigid_frame

from machining.cell import Body, Cell, Fixture, LinearAxis, Tool, Turntable, box
from robots.arrays import Array


def frame(R: Array, p: list[float]) -> Array:
    return rigid_frame(p, R)


@pytest.fixture
def gantry(rotation: Array) -> Cell:
    """Two axes, the second aslant; a turntable about a tilted axis."""
    return Cell(
        T_world_base0=frame(rotation, [1.0, 2.0, 0.5]),
        T_world_part0=frame(np.eye(3), [3.0, 0.0, 1.0]),
        linear_axes=(
            LinearAxis("x", np.array([2.0, 0.0, 0.0]), np.array([-1.0, 4.0])),
            LinearAxis("lift", np.array([0.0, 0.6, 0.8]), np.array([0.0, 1.0])),
        ),
        turntable=Turntable(np.array([2.0, 0.0, 0.0]), np.array([0.0, 0.0, 3.0]), np.array([-np.pi, np.pi])),
    )


def test_an_empty_cell_needs_nothing() -> None:
    cell = Cell()
    np.testing.assert_array_equal(cell.T_base_part(), np.eye(4)[None])
    np.testing.assert_array_equal(cell.T_world_base(np.zeros((3, 0))), np.tile(np.eye(4), (3, 1, 1)))
    assert cell.inside_limits().all()


def test_travels_add_up_along_their_directions(gantry: Cell, rotation: Array) -> None:
    T = gantry.T_world_base(np.array([[0.0, 0.0], [1.5, 0.0], [1.5, 0.5]]))
    np.testing.assert_allclose(T[:, :3, 3], [[1, 2, 0.5], [2.5, 2, 0.5], [2.5, 2.3, 0.9]], atol=1e-15)
    np.testing.assert_allclose(T[:, :3, :3], np.broadcast_to(rotation, (3, 3, 3)))
    # What stands behind the first axis moves with it alone.
    np.testing.assert_allclose(gantry.carried(np.array([[1.5, 0.5]]))[0], [[0, 0, 0], [1.5, 0, 0], [1.5, 0.3, 0.4]])


def test_the_turntable_turns_the_part_about_its_axis(gantry: Cell) -> None:
    T = gantry.T_world_part(np.array([0.0, np.pi / 2, np.pi]))
    np.testing.assert_allclose(T[:, :3, 3], [[3, 0, 1], [2, 1, 1], [1, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(T[1, :3, 0], [0, 1, 0], atol=1e-15)
    # Points on the axis stay.
    np.testing.assert_allclose(
        gantry.T_world_table(np.array([0.7]))[0] @ [2.0, 0.0, 5.0, 1.0], [2, 0, 5, 1], atol=1e-14
    )


def test_part_in_base_is_both_together(gantry: Cell) -> None:
    e, angle = np.array([[0.3, 0.2], [1.0, 0.9]]), np.array([0.4, -1.0])
    T = gantry.T_base_part(e, angle)
    np.testing.assert_allclose(gantry.T_world_base(e) @ T, gantry.T_world_part(angle), atol=1e-14)
    one = gantry.T_base_part(e[:1], angle)
    np.testing.assert_allclose(one[1], gantry.T_base_part(e[:1], angle[1:])[0], atol=1e-15)


def test_limits(gantry: Cell) -> None:
    e = np.array([[-1.0, 0.0], [-1.1, 0.0], [0.0, 1.01], [4.0, 1.0]])
    np.testing.assert_array_equal(gantry.inside_limits(e), [True, False, False, True])
    np.testing.assert_array_equal(gantry.inside_limits(e[:1], np.array([3.0, 4.0])), [True, False])
    endless = replace(gantry, turntable=Turntable(np.zeros(3), np.array([0.0, 0, 1])))
    assert endless.inside_limits(e[:1], np.array([40.0])).all()


def test_bad_cells_are_refused(gantry: Cell) -> None:
    up, pair = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0])
    block = Body("block", (box([1, 1, 1]),))
    for words, make in (
        ("direction", lambda: LinearAxis("z", np.zeros(3), pair)),
        ("linear axis z: limits", lambda: LinearAxis("z", up, pair[::-1])),
        ("linear axis z: speed", lambda: LinearAxis("z", up, pair, speed=0.0)),
        ("linear axis z: compliance", lambda: LinearAxis("z", up, pair, compliance=np.ones(5))),
        ("axis of the turntable", lambda: Turntable(np.zeros(3), np.zeros(3))),
        ("limits of the turntable", lambda: Turntable(np.zeros(3), up, np.array([1.0, 1.0]))),
        ("robot frame in the world", lambda: Cell(T_world_base0=2.0 * np.eye(4))),
        ("part frame in the world", lambda: Cell(T_world_part0=np.eye(3))),
        ("tool frame on the flange", lambda: Tool(np.full((4, 4), np.nan))),
        ("name in the cell: got 'block'", lambda: Cell(part=block, fixtures=(Fixture(block),))),
        ("fixture on the turntable", lambda: Cell(fixtures=(Fixture(block, on_turntable=True),))),
        ("linear axes: got 4", lambda: Cell(linear_axes=tuple(LinearAxis(n, up, pair) for n in "abcd"))),
        ("safety distance", lambda: Cell(safety=-1.0)),
        ("joint speeds", lambda: Cell(joint_speed=[1.0, 0.0])),
        ("travels of the linear axes", lambda: gantry.T_world_base(np.zeros((2, 3)))),
        ("travels of the linear axes", lambda: gantry.T_world_base(np.full((1, 2), np.nan))),
        ("angle of the turntable", lambda: Cell().T_world_part(np.array([0.1]))),
    ):
        refuses("B001 K001", words, make)
