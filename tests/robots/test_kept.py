"""Figures kept for each robot: worked out once, never another robot's, gone with it."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

from refusals import refuses

from robots import InputError, Robot, load_robot
from robots.kept import once_for_each


def test_a_figure_is_worked_out_once_for_each_robot() -> None:
    asked: list[str] = []

    @once_for_each
    def name(robot: Robot) -> str:
        asked.append(robot.name)
        return robot.name

    first = load_robot("kr60-3")
    other = replace(first, name="other")
    assert [name(r) for r in (first, other, first, other)] == ["kr60-3", "other", "kr60-3", "other"]
    assert asked == ["kr60-3", "other"]


def test_a_robot_that_is_gone_leaves_nothing_behind() -> None:
    """Robots that are made and dropped take each other's place in memory; none gets another's figure."""

    @once_for_each
    def name(robot: Robot) -> str:
        return robot.name

    robot = load_robot("kr60-3")
    for i in range(200):
        assert name(replace(robot, name=str(i))) == str(i)
    gone = weakref.ref(replace(robot, name="gone"))
    gc.collect()
    assert gone() is None


def test_errors_are_not_kept() -> None:
    count = 0

    @once_for_each
    def fails(robot: Robot) -> None:
        nonlocal count
        count += 1
        raise InputError("no", code="X004")

    robot = load_robot("kr60-3")
    for _ in range(2):
        refuses("X004", "", fails, robot)
    assert count == 2
