"""The map's page beyond points: planes, surfaces, ellipsoid, springs by hand, a second map, turning."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import needs_browser
from test_map_viewer_browser import probed
from viewer_maps import arm, joint_map, kr60_box, kr60_slice

from fem import compliance, directional_stiffness
from fem.arm import Arm
from stiffarm.commands.compare.map_page import page_of_both
from stiffarm.commands.maps.viewer import viewer_data, viewer_page
from stiffarm.commands.maps.what_if import interval_of, springs_of, turns_with_the_first_joint, what_if_data
from surrogate.maps.data import Axis, Field, Layout, MapData


@cache
def whole_arm(name: str) -> Arm:
    description, model = arm(name)
    return replace(Arm.of(description), model=model)


def with_load(data: MapData) -> MapData:
    return replace(data, metadata={**data.metadata, "load_direction": "0 0 -1"})


def page_of(data: MapData, name: str, **more: Any) -> str:
    description, model = arm(name)
    return viewer_page(data, description, model, title="map", **more)


# --- what the page is given ---------------------------------------------------------------------------------------


def test_points_under_the_floor_and_inside_the_base_are_known() -> None:
    data = kr60_slice(100.0)
    inside = replace(data, points=np.where(np.arange(data.layout.n)[:, None] == 0, [[0.0, 0.0, 0.05]], data.points))
    left = np.frombuffer(base64.b64decode(viewer_data(inside, *arm("kr60-3"))["left_out"]), np.uint8)
    assert left[0] == 2
    np.testing.assert_array_equal(left[1:] == 1, data.points[1:, 2] < -1e-6)
    # Those inside the base are near its axis.
    assert (np.linalg.norm(data.points[1:, :2], axis=1)[left[1:] == 2] < 0.5).all()


def test_intervals_of_springs_are_the_calibrations() -> None:
    given = whole_arm("kr60-3")
    names = [name for name, _ in springs_of(given.model)]
    assert "j2" in names
    value = dict(springs_of(given.model))["j2"]
    assert interval_of("j2", value, given.description) == {"low": 0.85, "high": 1.15, "known": False}


def test_joint_1_only_turns_an_arm_that_stands_firmly() -> None:
    assert turns_with_the_first_joint(whole_arm("kr60-3"))


# --- in a browser -------------------------------------------------------------------------------------------------


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("name", ["kr60-3", "xr701"])
def test_springs_by_hand_give_what_the_model_gives(name: str, tmp_path: Path) -> None:
    given = whole_arm(name)
    if name == "xr701":
        given = replace(given, model=given.model.with_springs({"j2": 9e5, "j3": 8e5}))
    robot, rng = given.robot, np.random.default_rng(3)
    q = rng.uniform(*robot.limits.T, (400, robot.dof))
    q = q[robot.reachable(q)][:40]
    swept = {c: np.array([-10.0, 5.0, 30.0]) for c in robot.coordinates[:2]}
    data = with_load(joint_map(name, swept, {robot.coordinates[2]: 60.0, robot.coordinates[4]: 30.0}))
    what_if = what_if_data(given, data)
    assert what_if is not None
    k = [s["name"] for s in what_if["springs"]].index("j3")
    probe = f"""
      const Q = {json.dumps(q.tolist())}, f = V.fields.findIndex(f => f.name === "stiffness_N_per_mm");
      out.plain = Q.map(V.learnedCompliance);
      V.setSpring({k}, 0.8); out.soft = Q.map(V.learnedCompliance); out.map = [...V.fields[f].values];
      out.whatIf = V.state.whatIf;
      V.setSpring({k}, 1); out.back = [...V.fields[f].values];"""
    seen, console = probed(page_of(data, name, what_if=what_if), tmp_path, probe)
    assert console == ""
    soft = given.model.with_springs({"j3": 0.8 * dict(springs_of(given.model))["j3"]})
    for found, model in (("plain", given.model), ("soft", soft)):
        expected = compliance(model, q)[:, :3, :3]
        size = np.abs(expected).max(axis=(1, 2), keepdims=True)
        # Coefficients are in single precision.
        np.testing.assert_allclose(np.array(seen[found]) / size, expected / size, atol=2e-6)
    assert seen["whatIf"]
    reached = np.asarray(data.reached)
    np.testing.assert_allclose(
        np.array(seen["map"], dtype=float)[reached], 1e-3 * directional_stiffness(soft, data.q[reached]), rtol=1e-5
    )
    kept = np.array(seen["back"], dtype=float)[reached]
    np.testing.assert_allclose(kept, data.fields["stiffness_N_per_mm"].values[reached], rtol=1e-5)


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("where", ["", "#canvas"])
def test_planes_surfaces_and_the_ellipsoid(where: str, tmp_path: Path) -> None:
    data = with_load(kr60_box(200.0))
    # Linear in space: every point of a surface then has its value.
    linear = 1000.0 + 1e3 * data.points @ [1.0, 0.3, -0.2]
    fields = {**data.fields, "linear": Field(np.where(data.reached, linear, np.nan), "N/mm", "linear")}
    data = replace(data, fields=fields)
    picked = int(np.flatnonzero(data.reached)[40])
    probe = f"""
      const k = V.fields.findIndex(f => f.name === "linear");
      V.setField(k); const plain = shot();
      set("surface", "three"); out.surfaces = V.surfaces().map(s => [s.level, [...s.pos]]);
      out.seen = shot() !== plain;
      set("surface", "none"); out.again = shot() === plain;
      set("aty", 100); out.half = V.counts().shown; set("sidey", "1"); out.other = V.counts().shown;
      tick("planey", false);
      out.all = V.counts().shown;
      V.pick({picked}); const with1 = shot(); out.round = V.ellipsoid().own.map(e => e.value);
      tick("ellipsoid", false); out.drawn = shot() !== with1;
      out.principal = rows("principal").map(r => r[1]);"""
    what_if = what_if_data(whole_arm("kr60-3"), data)
    seen, console = probed(page_of(data, "kr60-3", what_if=what_if), tmp_path, probe, where)
    assert console == ""
    assert len(seen["surfaces"]) == 3
    for level, pos in seen["surfaces"]:
        points = np.array(pos).reshape(-1, 3)
        assert len(points) > 30
        np.testing.assert_allclose(1000.0 + 1e3 * points @ [1.0, 0.3, -0.2], level, rtol=1e-3)
    assert seen["seen"]
    assert seen["again"]
    known = np.isfinite(data.fields["linear"].values)
    middle = 0.5 * (data.points[:, 1].min() + data.points[:, 1].max())
    below, above = ((known & (sign * (data.points[:, 1] - middle) >= -1e-6)).sum() for sign in (-1.0, 1.0))
    assert [seen["half"], seen["other"], seen["all"]] == [below, above, known.sum()]
    C = compliance(arm("kr60-3")[1], data.q[[picked]])[0, :3, :3]
    np.testing.assert_allclose(seen["round"], np.linalg.eigvalsh(C)[::-1], rtol=1e-4)
    np.testing.assert_allclose([float(v) for v in seen["principal"]], 1e-3 / np.linalg.eigvalsh(C)[::-1], rtol=1e-3)
    assert seen["drawn"]


@needs_browser
@pytest.mark.slow
def test_a_page_of_two_maps_opens_with_both(tmp_path: Path) -> None:
    data = kr60_slice(100.0)
    name = "stiffness_N_per_mm"
    twice = Field(2.0 * data.fields[name].values, "N/mm", data.fields[name].label)
    pages = [tmp_path / "a.html", tmp_path / "b.html"]
    for page, one in zip(pages, (data, replace(data, fields={**data.fields, name: twice})), strict=True):
        page.write_text(page_of(one, "kr60-3"), encoding="utf-8")
    both = page_of_both(*pages, "b </script>")
    assert both is not None
    probe = f"""
      out.two = V.mapsSeen().length;
      const k = V.fields.findIndex(f => f.name === "difference_{name}");
      out.difference = [...new Set([...V.fields[k].values].filter(Number.isFinite).map(v => v.toFixed(3)))];"""
    seen, console = probed(both, tmp_path, probe, "#canvas")
    assert console == ""
    assert (seen["two"], seen["difference"]) == (2, ["100.000"])


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("where", ["", "#canvas"])
def test_a_second_map_beside_on_one_scale_with_what_they_differ_by(where: str, tmp_path: Path) -> None:
    data = kr60_slice(100.0)
    name = "stiffness_N_per_mm"
    twice = Field(2.0 * data.fields[name].values, "N/mm", data.fields[name].label)
    other = page_of(replace(data, fields={**data.fields, name: twice}), "kr60-3")
    wrong = page_of(kr60_slice(200.0), "kr60-3")
    probe = f"""
      const a = shot(); out.garbage = V.showOther("<p>no map</p>", "x.html");
      out.wrong = V.showOther({json.dumps(wrong)}, "w.html");
      out.alone = V.mapsSeen().length;
      out.fault = V.showOther({json.dumps(other)}, "o.html"); out.two = V.mapsSeen().length;
      out.changed = shot() !== a;
      out.scale = [V.state.low, V.state.high];
      const k = V.fields.findIndex(f => f.name === "difference_{name}");
      out.difference = [...new Set([...V.fields[k].values].filter(Number.isFinite).map(v => v.toFixed(4)))];
      V.setField(k); out.label = V.fields[k].label; shot(); V.setField(0); set("views2", "1");
      out.back = V.mapsSeen().length;"""
    seen, console = probed(page_of(data, "kr60-3"), tmp_path, probe.replace("</", "<\\/"), where)
    assert console == ""
    assert "not a map page" in seen["garbage"]
    assert "different points" in seen["wrong"]
    assert [seen["alone"], seen["two"], seen["back"]] == [1, 2, 1]
    assert seen["fault"] == ""
    assert seen["changed"]
    assert seen["difference"] == ["100.0000"]
    values = data.fields[name].values
    assert seen["scale"][0] <= np.nanquantile(values, 0.03)
    assert seen["scale"][1] >= 2.0 * np.nanquantile(values, 0.95)


@pytest.mark.slow
@needs_browser
def test_unsure_places_are_striped_or_fade_and_turning_draws_less(tmp_path: Path) -> None:
    angles = [np.linspace(low, high, 13) for low, high in ((-90, 90), (-35, 45), (40, 115), (-80, 80))]
    data = joint_map("xr701", dict(zip(("q4_deg", "q2_deg", "q3real_deg", "q5_deg"), angles, strict=True)), {})
    unsure = np.where(data.reached, np.linspace(1.0, 40.0, data.layout.n), np.nan)
    data = replace(data, fields={**data.fields, "uncertainty_percent": Field(unsure, "percent", "uncertainty")})
    probe = """
      const plain = shot(); set("doubt", "hatch"); const hatch = shot(); set("doubt", "fade"); const fade = shot();
      set("doubt", "none");
      out.differ = [hatch !== plain, fade !== plain, hatch !== fade, shot() === plain];
      const b = $("view").getBoundingClientRect(), at = x => ({
        clientX: b.left + x, clientY: b.top + 200, bubbles: true, pointerId: 1, button: 0, buttons: 1 });
      $("view").dispatchEvent(new PointerEvent("pointerdown", at(100)));
      $("view").dispatchEvent(new PointerEvent("pointermove", at(150)));
      out.turning = V.drawnWhileTurning(); V.frame(); out.coarse = $("view").width;
      $("view").dispatchEvent(new PointerEvent("pointerup", at(150))); V.drawNow(); out.full = $("view").width;
      out.rest = V.drawnWhileTurning() > 1e9;"""
    seen, console = probed(page_of(data, "xr701"), tmp_path, probe)
    assert console == ""
    assert seen["differ"] == [True, True, True, True]
    assert seen["turning"] < 0.3 * data.layout.n
    assert seen["coarse"] < 0.8 * seen["full"]
    assert seen["rest"]


@pytest.mark.slow
@needs_browser
def test_a_picture_taken_out_of_the_page_keeps_its_warning(tmp_path: Path) -> None:
    data = kr60_slice(200.0)
    warned = replace(data, metadata={**data.metadata, "warning": "Not calibrated: no joint has a spring."})
    sizes = []
    for one in (data, warned):
        probe = """V.drawNow(); const p = V.picture(), pen = p.getContext("2d");
          out.size = [p.width, p.height - $("view").height]; out.head = $("caution")?.textContent ?? "";
          out.foot = [...pen.getImageData(p.width - 3, p.height - 2, 1, 1).data];"""
        seen, console = probed(page_of(one, "kr60-3"), tmp_path, probe)
        assert console == ""
        sizes.append(seen)
    assert sizes[0]["size"][1] == 0
    assert sizes[1]["size"][1] > 15
    assert sizes[1]["foot"][:3] == [0xFF, 0xE9, 0xC2]
    assert [one["head"] for one in sizes] == ["", warned.metadata["warning"]]


@pytest.mark.slow
@needs_browser
def test_surfaces_of_a_full_turn_close(tmp_path: Path) -> None:
    phi, r, z = np.arange(-180.0, 180.0, 30.0), np.array([500.0, 900.0, 1300.0]), np.array([400.0, 800.0])
    grids = np.meshgrid(z, phi, r, indexing="ij")
    angle = np.radians(grids[1].ravel())
    points = 1e-3 * np.column_stack(
        [grids[2].ravel() * np.cos(angle), grids[2].ravel() * np.sin(angle), grids[0].ravel()]
    )
    axes = (Axis("z", "mm", z), Axis("phi", "deg", phi), Axis("r", "mm", r))
    n, (description, model) = len(points), arm("kr60-3")
    fields = {"radius": Field(grids[2].ravel(), "N/mm", "radius")}
    q = np.tile(np.radians([0.0, -60.0, 90.0, 0.0, 40.0, 0.0]), (n, 1))
    data = MapData(
        Layout("cylinder", axes), points, q, np.ones(n, dtype=bool), model.robot.coordinates, fields, metadata={}
    )
    probe = """V.setLimit(700, false); set("surface", "threshold"); out.pos = V.surfaces().map(s => [...s.pos]);"""
    seen, console = probed(viewer_page(data, description, model, title="turn"), tmp_path, probe)
    assert console == ""
    (pos,) = seen["pos"]
    found = np.array(pos).reshape(-1, 3)
    around = np.histogram(np.degrees(np.arctan2(found[:, 1], found[:, 0])), 12, (-180.0, 180.0))[0]
    assert (around > 0).all()
