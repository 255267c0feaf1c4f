"""Measurement sheets: rows in the order of measuring, a table that reads back, a page that is safe and whole."""

from __future__ import annotations

import base64
import csv
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from cli_runs import HOSTILE_TITLE

from doe import read_measurements
from doe.planning.protocol import Protocol
from robots import InputError, load_description, load_robot
from stiffarm.commands.plan.sheets import Sheet, grid, render_sheet, write_table
from stiffarm.pages.pose_pictures import HEIGHT, WIDTH, pose_pictures

ROBOT = load_robot("xr701")
POSES = np.radians([[0.0, 5.0, 77.5, 0.0, -30.0, 0.0], [10.0, 20.0, 90.0, 45.0, 12.0, 0.0]])
FORCES = (150.0, 375.0, 650.0)


def sheet(**changes: object) -> Sheet:
    """Two set-ups; ``changes``: of the sheet or of what is done in each set-up."""
    ways = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    done = Protocol(np.array(FORCES), ways, (2,), 2)
    own = {name: changes.pop(name) for name in ("components", "repeats", "unloading") if name in changes}
    hints = ("roughly dz ≈ −1 mm", "")
    plain = Sheet(
        ROBOT, "Sheet", POSES, ways, ("N1", "N2"), hints, replace(done, **own), (("robot", "xr701"),), ("Heed this.",)
    )  # type: ignore[arg-type]
    return replace(plain, **changes)  # type: ignore[arg-type]


class Page(HTMLParser):
    """What a page refers to, which tags it leaves open, and its text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.count: dict[str, int] = {}
        self.references: list[str] = []
        self.words: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.count[tag] = self.count.get(tag, 0) + 1
        self.references += [v or "" for k, v in attrs if k in ("src", "href")]
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_rows_come_in_the_order_of_measuring() -> None:
    rows = sheet().table
    assert rows.step.tolist() == list(range(1, 13))
    assert rows.pose == ("N1",) * 6 + ("N2",) * 6
    assert rows.loads_N.tolist() == [*FORCES] * 4
    assert rows.repeat == (1, 1, 1, 2, 2, 2) * 2
    assert set(rows.phase) == {None}


def test_unloading_goes_down_the_same_steps() -> None:
    rows = sheet(unloading=True, repeats=1).table
    assert rows.loads_N[:5].tolist() == [150.0, 375.0, 650.0, 375.0, 150.0]
    assert rows.phase[:5] == ("loading",) * 3 + ("unloading",) * 2


@pytest.mark.parametrize("components", [(2,), (0, 1, 2), (0, 1, 2, 3, 4, 5)])
@pytest.mark.parametrize("unloading", [False, True])
def test_a_filled_table_reads_back(components: tuple[int, ...], unloading: bool, tmp_path: Path) -> None:
    one = sheet(components=components, unloading=unloading)
    path = tmp_path / "sheet.csv"
    write_table(one, path)
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    columns = [name for name in rows[0] if re.fullmatch(r"[dr][xyz]_m(m|rad)", name)]
    assert len(columns) == len(components)
    assert all(row[name] == "" for row in rows for name in columns)
    for k, row in enumerate(rows):
        row.update(dict.fromkeys(columns, f"{-0.01 * (k + 1):.2f}") if k % 3 else {})
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    back = read_measurements(path, ROBOT)
    expected = one.table
    filled = np.arange(len(rows)) % 3 > 0
    np.testing.assert_allclose(back.q, expected.q[filled], atol=1e-12)
    np.testing.assert_allclose(back.wrench, expected.wrench[filled], atol=1e-12)
    assert back.step.tolist() == expected.step[filled].tolist()
    assert back.phase == tuple(np.array(expected.phase)[filled])
    assert np.flatnonzero(back.used.any(axis=0)).tolist() == list(components)
    assert f"{(~filled).sum()} row(s) without any reading skipped: 2, 5, 8" in " ".join(back.notes)


def test_an_empty_table_says_what_to_do(tmp_path: Path) -> None:
    write_table(sheet(), tmp_path / "sheet.csv")
    with pytest.raises(InputError, match=r"no deflection was read, here or in any row.*fill in the readings"):
        read_measurements(tmp_path / "sheet.csv", ROBOT)


@pytest.mark.parametrize(
    ("changes", "columns", "lines"),
    [
        ({}, 2, 3),
        ({"components": (0, 1, 2), "repeats": 3}, 9, 3),
        ({"components": (0, 1, 2, 3, 4, 5), "repeats": 3}, 6, 9),
        ({"unloading": True, "repeats": 1}, 1, 5),
    ],
)
def test_there_is_a_box_for_every_reading(changes: dict[str, object], columns: int, lines: int) -> None:
    one = sheet(**changes)
    table = one.table
    boxes = grid(one.protocol)
    assert len(boxes.columns) == columns
    assert len(boxes.lines) == lines
    assert sum(width for _, width in boxes.groups) in (0, columns)
    steps = [step for _, line in boxes.lines for step in line]
    mine = table.step[np.array(table.pose) == "N1"]
    assert sorted(steps) == sorted(np.repeat(mine, len(one.protocol.components)))
    page = Page(render_sheet(one, ["", ""]))
    assert page.open == []
    assert page.count["small"] == table.n * len(one.protocol.components)


def test_boxes_stand_beside_the_load_of_their_row() -> None:
    one = sheet(unloading=True)
    table = one.table
    for name, steps in grid(one.protocol, table.n // 2).lines:
        rows = np.array(steps) - 1
        assert {table.pose[k] for k in rows} == {"N2"}
        assert [table.repeat[k] for k in rows] == [1, 2]
        arrow = {"loading": "↑", "unloading": "↓"}
        assert {f"{table.loads_N[k]:g} N {arrow[str(table.phase[k])]}" for k in rows} == {name}


def test_the_page_is_safe_and_self_contained() -> None:
    hostile = sheet(
        title=HOSTILE_TITLE,
        facts=(("robot", HOSTILE_TITLE),),
        q=POSES[:1],
        direction=np.array([[0.0, 0.0, -1.0]]),
        labels=("<b>&",),
        hints=(HOSTILE_TITLE,),
    )
    html = render_sheet(hostile, [base64.b64encode(b"picture").decode()])
    page = Page(html)
    assert page.open == []
    assert "<script" not in html
    assert "b" not in page.open
    assert page.references == ["data:image/png;base64," + base64.b64encode(b"picture").decode()]
    assert "://" not in html
    text = " ".join(page.words)
    assert HOSTILE_TITLE in text
    for words in ("signature", "gauge", "date", "serial number", "down (−z)", "q3real (deg)", "77.5", "−30", "<b>&"):
        assert words in text


def test_a_second_direction_in_the_same_pose_is_said() -> None:
    one = sheet()
    twice = sheet(q=POSES[[0, 0]])
    assert "same pose as before" in render_sheet(twice, ["", ""])
    assert "same pose as before" not in render_sheet(one, ["", ""])


@pytest.mark.slow
def test_pictures_show_the_arm_and_the_load() -> None:
    description = load_description("kr60-3")
    robot = load_robot("kr60-3")
    q = np.radians([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0]])
    seen: list[tuple[int, int]] = []
    (down,) = pose_pictures(description, robot, q, np.array([[0.0, 0.0, -1.0]]), lambda a, b: seen.append((a, b)))
    (side,) = pose_pictures(description, robot, q, np.array([[1.0, 0.0, 0.0]]))
    data = base64.b64decode(down)
    assert data.startswith(b"\x89PNG")
    assert (int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")) == (WIDTH, HEIGHT)
    assert down != side
    assert seen == [(1, 1)]
