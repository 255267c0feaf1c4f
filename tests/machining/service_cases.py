"""What the tests of the service share: sessions of a KUKA KR60 in empty cells and in one with a rail and bodies."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from posture_cases import part, spindle

import fem
from machining.cell import Cell, LinearAxis, Tool, arm_of, parse_cell
from machining.service import Session
from robots.arrays import Array

ROOT = Path(__file__).resolve().parents[2]
RAIL = ROOT / "docs" / "examples" / "serve" / "cell.toml"
POSE = [10.0, -80.0, 40.0, 15.0, 60.0, 20.0]
POINT: dict[str, Any] = {"point_mm": [0, 0, 0], "tool_axis": [0.1, 0.2, 1]}


def turned_part() -> Array:
    """The part, turned so that no axis is one of the base's."""
    T = part()
    a, b = 0.3, -0.2
    Rz = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    Rx = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    T[:3, :3] = Rz @ Rx
    return T


def plain(model: fem.ArmModel) -> Session:
    """Spindle and turned part, no bodies."""
    return Session(model, Cell(T_world_part0=turned_part(), tool=Tool(spindle())))


def on_rail(model: fem.ArmModel) -> Session:
    """A rail along y that gives way, spindle and turned part, no bodies."""
    rail = LinearAxis("rail", np.array([0.0, 1.0, 0.0]), np.array([-1.5, 1.5]), compliance=np.full(6, 2e-8))
    return Session(model, Cell(T_world_part0=turned_part(), tool=Tool(spindle()), linear_axes=(rail,)))


def with_bodies(model: fem.ArmModel, more: str = "", safety_mm: float = 10.0) -> Session:
    """The cell of the example, arm's surfaces and all; ``more``: TOML after it."""
    text = RAIL.read_text(encoding="utf-8").replace("safety_mm = 10", f"safety_mm = {safety_mm}")
    return Session(model, parse_cell(text + more, "cell", RAIL.parent), arm_of("kr60-3"))


def raw(session: Session, request: Any) -> Any:
    """The answer to a request, through its line."""

    def refuse(name: str) -> None:
        raise ValueError(f"{name} is no JSON")

    line = session.answer(json.dumps(request).encode())
    assert line.endswith(b"\n")
    assert line.count(b"\n") == 1
    return json.loads(line, parse_constant=refuse)


def ask(session: Session, do: str, **keys: Any) -> Any:
    """The answer to a request that must be fine."""
    answer = raw(session, {"id": "x", "do": do, **keys})
    assert answer["ok"], answer
    assert answer["id"] == "x"
    return answer


def refused(session: Session, do: str, **keys: Any) -> Any:
    """The error of a request that must be refused."""
    answer = raw(session, {"id": 7, "do": do, **keys})
    assert not answer["ok"], answer
    assert answer["id"] == 7
    assert {"what", "value", "allowed", "remedy"} <= set(answer["error"])
    return answer["error"]
