"""The replay: one page that needs nothing else, whose kinematics are the project's, and that runs in a browser."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import browse, needs_browser, with_probe
from numpy.typing import NDArray
from verify_cases import many_moves, parallelogram_program, verified

from machining.cell import arm_of
from machining.verification import Verification, contact_of, verify
from robots.quantities import significant
from stiffarm.commands.verify.replay import MOST_POINTS, kept_points, replay_data, replay_page
from stiffarm.pages.cell_bodies import body_surfaces, placed_in_world

HOSTILE = "<script>alert('x')</script> {{ 7 * 7 }} </title>"


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Verification:
    return verified(tmp_path_factory.mktemp("replay"))


def unpacked(text: str, kind: str) -> NDArray[Any]:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def test_the_page_needs_nothing_else(found: Verification) -> None:
    page = replay_page(found, HOSTILE)
    assert "<script>alert" not in page
    assert "<title>&lt;script&gt;" in page
    assert not re.search(r"""(src|href)\s*=|url\(|import\s|fetch\(|XMLHttpRequest""", page)
    assert "default-src 'none'" in page
    assert page.count("</script>") == 2


def test_the_data_are_the_programs(found: Verification) -> None:
    data = replay_data(found)
    n = found.program.n
    np.testing.assert_allclose(unpacked(data["values"], "<f4").reshape(n, -1), found.program.q, atol=1e-6)
    np.testing.assert_allclose(unpacked(data["tips"], "<f4").reshape(n, 3), found.program.motions.points, atol=1e-6)
    np.testing.assert_array_equal(unpacked(data["line"], "<i4"), found.program.motions.line)
    assert [o["line"] for o in data["offences"]] == [o.line for o in found.ranked]
    distance = unpacked(data["clearance"], "<f4")
    assert (distance < 0.0).sum() == np.isfinite(found.swept.hit).sum()


def test_bodies_hold_their_solids(found: Verification) -> None:
    surfaces = body_surfaces(found.scenes[0])
    assert [s.name for s in surfaces] == [m.body.name for m in found.scenes[0].members]
    for surface, member in zip(surfaces, found.scenes[0].members, strict=True):
        nodes = np.vstack([solid.nodes for solid in member.body.solids])
        radius = max(solid.radius for solid in member.body.solids)
        np.testing.assert_allclose(surface.vertices.max(axis=0), nodes.max(axis=0) + radius, atol=1e-9)
    world = placed_in_world(found.scenes[0], surfaces, found.program.q[0], np.zeros(0), 0.0)
    part = next(x for s, x in zip(surfaces, world, strict=True) if s.name == "part")
    np.testing.assert_allclose(part.mean(axis=0), [1.3, 0.1, 0.65], atol=1e-9)


def test_long_programs_are_thinned_but_keep_their_offences(found: Verification) -> None:
    assert len(kept_points(found)) == found.program.n
    kept = kept_points(found, 20)
    assert len(kept) <= 20 + 3 * len(found.offences)
    assert {0, found.program.n - 1} <= set(kept)
    assert {o.move for o in found.offences} <= set(kept)


@pytest.mark.slow
def test_a_page_of_ten_thousand_moves_is_small(tmp_path: Path) -> None:
    page = replay_page(many_moves(tmp_path, 10_000), "long")
    assert len(page) < 2e6
    assert MOST_POINTS * 60 * 4 / 3 < 5e6


PROBE = """
<script>
addEventListener("load", () => setTimeout(() => {
  const $ = id => document.getElementById(id), view = $("view"), slider = $("slider"), R = window.replay, out = {};
  const cell = k => $("here").rows[k].cells[1].textContent;
  const key = (target, name) => target.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true }));
  const shot = () => [...view.toDataURL()].reduce((h, c) => (31 * h + c.charCodeAt(0)) | 0, 0);
  const label = () => $("contact").hidden ? "" : $("contact").lastElementChild.textContent;
  Object.assign(out, { renderer: R.renderer, opened: R.state.place, openedLabel: label() });
  out.openedNow = !$("now").hidden;
  R.go(0);
  Object.assign(out, { first: shot(), firstLine: cell(0), firstLabel: label() });
  slider.value = 30.5; slider.dispatchEvent(new Event("input"));
  Object.assign(out, { moved: shot(), movedLine: cell(0), frames: R.frames(30.5) });
  key(view, "ArrowLeft"); out.turned = shot();
  key(document, "p"); key(document.body, "n"); out.jumped = R.state.place;
  document.querySelector("#list button").click();
  Object.assign(out, { offenceLine: cell(0), offencePlace: R.state.place, clearance: cell(4) });
  out.marks = document.querySelectorAll("#marks button").length;
  out.current = document.querySelectorAll("#list [aria-current=true]").length;
  out.marked = document.querySelectorAll("#marks [aria-current=true]").length;
  out.hot = $("list").querySelector("[aria-current=true]") === $("list").querySelector("button");
  key(slider, "ArrowRight"); out.stepped = R.state.place;
  $("play").click(); out.playing = R.state.playing; $("play").click();
  const pre = document.createElement("pre"); pre.id = "probe"; pre.textContent = JSON.stringify(out);
  document.body.append(pre);
}, 200));
</script>
"""


def check_frames(found: Verification, frames: list[list[float]], move: int) -> None:
    """The page's frames half-way through a move are the project's, in the world frame."""
    courses, scene = found.courses, found.scenes[0]
    values, _ = courses.at(np.array([move]), np.array([0.5]))
    q, travel, table = courses.axes.parts(values)
    R, p = (x[0] for x in scene.frames(q, travel, table))
    base = found.program.cell.T_world_base(travel)[0]
    got = np.array(frames).reshape(-1, 4, 4).swapaxes(1, 2)
    # Angles travel as 32-bit floats: 2e-7 rad on 2 m.
    np.testing.assert_allclose(got[:, :3, :3], base[:3, :3] @ R, atol=2e-6)
    np.testing.assert_allclose(got[:, :3, 3], p @ base[:3, :3].T + base[:3, 3], atol=2e-6)


@pytest.mark.slow
@needs_browser
def test_crank_bar_rail_and_turntable_move_in_the_browser(tmp_path: Path) -> None:
    found = verify(parallelogram_program(), arm_of("xr701"))
    page = tmp_path / "replay.html"
    probe = PROBE.replace("30.5", "1.5").replace('document.querySelector("#list button")', "view")
    page.write_text(with_probe(replay_page(found, "arm"), probe), encoding="utf-8")
    seen, console = browse(page)
    assert console == ""
    check_frames(found, seen["frames"], 2)


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("where", ["", "#canvas"])
def test_the_page_runs_in_a_browser(found: Verification, tmp_path: Path, where: str) -> None:
    page = tmp_path / "replay.html"
    page.write_text(with_probe(replay_page(found, HOSTILE), PROBE), encoding="utf-8")
    seen, console = browse(page, where)
    assert console == ""
    if where:
        assert "canvas" in seen["renderer"]
    assert (seen["firstLine"], seen["movedLine"]) == ("11", "42")
    assert len({seen["first"], seen["moved"], seen["turned"]}) == 3
    check_frames(found, seen["frames"], 31)
    # It opens at the worst offence, marks it and says how deep it is.
    worst = contact_of(found, found.ranked[0])
    assert worst is not None
    place = worst.move - 1 + worst.at
    assert (seen["opened"], seen["openedNow"]) == (pytest.approx(place), True)
    assert seen["openedLabel"] == f"{significant(-worst.gap * 1e3)} mm into each other"
    assert seen["firstLabel"] == ""
    assert (seen["marked"], seen["hot"]) == (1, True)
    assert seen["offenceLine"] == str(worst.line)
    assert seen["offencePlace"] == pytest.approx(place)
    assert seen["jumped"] == seen["offencePlace"]
    assert seen["clearance"] == "overlap"
    assert seen["marks"] >= 1
    assert seen["current"] >= 1
    assert seen["stepped"] == round(seen["offencePlace"]) + 1
    assert seen["playing"] is True
