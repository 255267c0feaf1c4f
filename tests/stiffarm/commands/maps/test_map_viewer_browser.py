"""The map's page in a browser: no error, robot and numbers are the model's, and its controls do what they say."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import browse, needs_browser, with_probe
from viewer_maps import DOWN, arm, joint_map, kr60_box, kr60_slice, xr701_sweep

from fem import compliance_budget, directional_stiffness
from robots import forward_kinematics
from robots.constants import NORMAL_95
from robots.frames import framed
from robots.kinematics import moving_frames
from stiffarm.commands.maps.viewer import DIGITS, viewer_page
from surrogate.maps.data import Field, MapData

HOSTILE = "<script>alert('x')</script> {{ 7 * 7 }} </title>"
ROBOTS = ("xr701", "kr60-3", "tx200")
pytestmark = [pytest.mark.slow, needs_browser]


HELPERS = """
const $ = id => document.getElementById(id), V = window.mapViewer, out = {};
const shot = () => {
  V.drawNow();
  return [...$("view").toDataURL()].reduce((h, c) => (31 * h + c.charCodeAt(0)) | 0, 0);
};
const set = (id, value) => {
  $(id).value = value;
  $(id).dispatchEvent(new Event($(id).tagName === "SELECT" ? "change" : "input"));
};
const tick = (id, on) => { if ($(id).checked !== on) $(id).click(); };
const key = name => $("view").dispatchEvent(new KeyboardEvent("keydown", { key: name }));
const click = i => { // Where the point is seen, on whatever lies on top there.
  const r = $("view").getBoundingClientRect(), [x, y] = V.placeOf(i);
  const at = { clientX: r.left + x, clientY: r.top + y, bubbles: true, pointerId: 1, button: 0 };
  const target = document.elementFromPoint(at.clientX, at.clientY);
  target.dispatchEvent(new PointerEvent("pointerdown", at));
  target.dispatchEvent(new PointerEvent("pointerup", at));
  return target.id;
};
const number = text => Number(text.replace("\\u2212", "-"));
const rows = id => [...$(id).querySelectorAll("tr")].map(r => [...r.cells].map(c => c.textContent));
const panel = () => ({
  picked: V.state.picked, interval: $("interval").textContent, flags: $("flags").textContent,
  head: number($("headline").querySelector("b").textContent), values: rows("values"),
  place: rows("place").map(r => number(r[1])), pose: rows("pose").map(r => number(r[1])),
  budget: [...$("budget").children].map(li => [
    li.querySelector(".part").textContent, parseFloat(li.querySelector(".percent").textContent)]),
});
"""


def rounded(value: float, digits: int = DIGITS) -> float:
    return float(f"{value:.{digits}g}")


def probed(page: str, folder: Path, probe: str, where: str = "", size: str = "1400,900") -> tuple[Any, str]:
    """What a probe (statements that fill ``out``) saw in a browser, and what the browser's console said."""
    script = (
        f"<script>addEventListener('load', () => setTimeout(() => {{ {HELPERS} {probe}\n"
        "const pre = document.createElement('pre'); pre.id = 'probe'; pre.textContent = JSON.stringify(out);"
        "document.body.append(pre); }, 200));</script>"
    )
    file = folder / "map.html"
    file.write_text(with_probe(page, script), encoding="utf-8")
    return browse(file, where, size)


def check_panel(seen: dict[str, Any], data: MapData, name: str) -> None:
    """The panel's numbers are the model's at the pose of the picked point."""
    _, model = arm(name)
    i = seen["picked"]
    q = data.q[i]
    stiffness = float(directional_stiffness(model, q[None])[0]) * 1e-3
    assert seen["head"] == rounded(stiffness)
    by_label = {row[0]: row[1] for row in seen["values"]}
    assert float(by_label["stiffness along the load"].split("\u00a0")[0]) == rounded(stiffness)
    assert float(by_label["compliance along the load"]) == rounded(1e3 / stiffness)
    # Written with one decimal of a mm and two of a degree; half of that, and what single precision leaves.
    np.testing.assert_allclose(seen["place"], data.points[i] * 1e3, atol=0.0503)
    np.testing.assert_allclose(seen["pose"], np.degrees(q), atol=0.00501)
    budget = compliance_budget(model, q[None], DOWN)
    shares = dict(zip(budget.parts, 100.0 * budget.share[0], strict=True))
    written = [(part, value) for part, value in seen["budget"] if part != "all others"]
    assert [part for part, _ in written] == sorted(dict(written), key=lambda p: -shares[p])
    for part, value in written:
        assert value == pytest.approx(shares[part], abs=0.0501)
    assert by_label["part that deflects most"] == written[0][0]
    assert sum(value for _, value in seen["budget"]) == pytest.approx(100.0, abs=0.35)


def test_the_robot_in_the_page_is_the_models(tmp_path: Path) -> None:
    for name in ROBOTS:
        description, model = arm(name)
        robot = model.robot
        first = {c: np.array([-20.0, 10.0]) for c in robot.coordinates[:2]}
        data = joint_map(name, first, {robot.coordinates[2]: 60.0, robot.coordinates[4]: 30.0})
        poses = np.random.default_rng(5).uniform(*robot.limits.T, (20, robot.dof))
        probe = f"const P = {json.dumps(poses.tolist())}; out.frames = P.map(V.frames); out.tool = P.map(V.tool);"
        seen, console = probed(viewer_page(data, description, model, title=name), tmp_path, probe)
        assert console == ""
        frames, moving = forward_kinematics(robot, poses), framed(*moving_frames(robot, poses))
        for k in range(len(poses)):
            got = np.array(seen["frames"][k]).reshape(-1, 4, 4).swapaxes(1, 2)
            np.testing.assert_allclose(got, moving[k], atol=1e-9)
        tool = frames.p_flange + frames.R_flange @ robot.T_flange_tool[:3, 3]
        np.testing.assert_allclose(seen["tool"], tool, atol=1e-9)


@pytest.mark.parametrize("where", ["", "#canvas"])
def test_a_sweep_of_the_joints(tmp_path: Path, where: str) -> None:
    data = xr701_sweep(6)
    description, model = arm("xr701")
    stiffness = data.fields["stiffness_N_per_mm"].values
    error = 0.004 + 0.01 * np.random.default_rng(1).random(data.layout.n)
    limit = float(np.nanmedian(stiffness)) * 1.2
    uncertainty = Field(100.0 / NORMAL_95 * error, "percent", "standard uncertainty")
    sure = replace(data, fields={**data.fields, "uncertainty_percent": uncertainty}, metadata={HOSTILE: HOSTILE})
    page = viewer_page(sure, description, model, title=HOSTILE)
    probe = f"""
      const count = () => V.counts().shown;
      Object.assign(out, {{ renderer: V.renderer, message: $("message").textContent, title: document.title }});
      Object.assign(out, {{ first: shot(), all: count() }});
      set("cut0", 1);
      out.layerWords = $("cuts").querySelector("output").textContent;
      Object.assign(out, {{ layer: count(), layerShot: shot() }});
      set("limit", "{limit!r}");
      Object.assign(out, {{ above: count(), aboveShot: shot(), countWords: $("count").textContent }});
      set("above", "0"); out.below = count();
      set("above", "1"); tick("filter", false); $("cuts").querySelector("input[type=checkbox]").click();
      Object.assign(out, {{ again: count(), againShot: shot() }});
      set("limitSlider", "700"); out.slid = [count(), Number($("limit").value), $("filter").checked];
      tick("filter", false);
      $("mostButton").click(); out.most = panel(); out.robotMoved = shot();
      $("leastButton").click(); out.least = panel();
      document.querySelector("[data-view=side]").click();
      out.hit = click({int(np.flatnonzero(data.reached)[137])});
      Object.assign(out, {{ clicked: panel(), tool: V.tool(V.state.pose) }});
      key("n"); out.next = V.state.picked;
      const before = shot(); key("ArrowLeft"); out.turned = shot() !== before;
      $("projection").click(); out.parallel = shot() !== before; $("projection").click();
      set("field", 1); out.compliance = [$("above").options[0].textContent, V.extremes(1, false)[0]];
      set("field", 3); out.thresholdHidden = $("thresholdPart").hidden;
      out.legend = [...$("categoryList").children].filter(l => !l.hidden).map(l => l.textContent);
      $("categoryList").querySelector("li:not([hidden]) input").click(); out.withoutFirst = count();
      out.unlabelled = [...document.querySelectorAll("input, select, button")]
        .filter(e => !(e.labels?.length || e.ariaLabel || e.textContent.trim())).map(e => e.id);
      out.scripts = document.querySelectorAll("script").length;"""
    seen, console = probed(page, tmp_path, probe, where)
    assert console == ""
    assert seen["title"] == f"{HOSTILE}: map"
    assert seen["renderer"] == ("2-D canvas" if where else "WebGL")
    assert ("No WebGL" in seen["message"]) == bool(where)
    layer = data.layout.indices(slice(None))[0] == 1
    usable = data.reached & np.isfinite(stiffness)
    assert seen["all"] == usable.sum() == seen["again"]
    assert seen["layer"] == (usable & layer).sum()
    assert seen["layerWords"] == "\u221230 °"
    assert seen["above"] == (usable & layer & (stiffness >= limit)).sum() > 0
    assert seen["below"] == (usable & layer & (stiffness <= limit)).sum()
    assert seen["countWords"].startswith(f"{seen['above']} of {seen['layer']} points shown")
    assert len({seen["first"], seen["layerShot"], seen["aboveShot"], seen["robotMoved"]}) == 4
    assert seen["againShot"] == seen["first"]
    count, slid, filtered = seen["slid"]
    assert filtered
    assert count == (usable & (stiffness >= slid)).sum()
    assert seen["most"]["picked"] == np.nanargmax(stiffness)
    assert seen["least"]["picked"] == np.nanargmin(stiffness)
    for key in ("most", "least", "clicked"):
        check_panel(seen[key], data, "xr701")
        i = seen[key]["picked"]
        low, high, share = (float(x) for x in re.findall(r"[\d.]+", seen[key]["interval"])[1:4])
        assert low == pytest.approx(stiffness[i] / (1.0 + error[i]), rel=5.1e-4)  # four digits are written
        assert high == pytest.approx(stiffness[i] / (1.0 - error[i]), rel=5.1e-4)
        assert share == pytest.approx(100.0 * error[i], rel=0.051)
    assert seen["hit"] == "view"
    # What was clicked is in front at that place: the point itself, or one that covers its middle.
    np.testing.assert_allclose(seen["tool"], data.points[seen["clicked"]["picked"]], atol=1e-6)
    assert seen["next"] != seen["clicked"]["picked"]
    assert seen["turned"]
    assert seen["parallel"]
    assert seen["compliance"] == ["stiffer than", int(np.nanargmax(stiffness))]
    worst = data.fields["softest_part"]
    found = [worst.categories[int(k)] for k in np.unique(worst.values[data.reached])]
    assert [words.rsplit(" ", 1)[0] for words in seen["legend"]] == found
    assert seen["thresholdHidden"]
    first = worst.categories.index(found[0])
    assert seen["withoutFirst"] == (worst.values[data.reached] != first).sum()
    assert seen["unlabelled"] == []
    # The data, the page's script and the probe.
    assert seen["scripts"] == 3


@pytest.mark.parametrize("where", ["#view=side", "#canvas&view=side"])
def test_a_slice_has_cells_and_says_what_is_not_reached(tmp_path: Path, where: str) -> None:
    data = kr60_slice(100.0)
    description, model = arm("kr60-3")
    good, bad = int(np.flatnonzero(data.reached)[120]), int(np.flatnonzero(~data.reached)[-1])
    probe = f"""
      tick("under", false); out.cells = $("cells").disabled;
      const a = shot();
      tick("cells", false); out.dots = shot() !== a;
      tick("cells", true); out.same = shot() === a;
      out.hit = click({good}); out.good = panel(); const pose = [...V.state.pose];
      click({bad}); out.bad = panel(); out.kept = JSON.stringify(pose) === JSON.stringify(V.state.pose);
      tick("unreached", false); out.without = shot() !== a; out.hiddenNote = $("hiddenPick").hidden;
      set("cut0", 3); out.line = [V.counts().shown, $("cells").disabled];"""
    seen, console = probed(viewer_page(data, description, model, title="slice"), tmp_path, probe, where)
    assert console == ""
    assert not seen["cells"]
    assert seen["dots"]
    assert seen["same"]
    assert seen["hit"] == "view"
    # No point lies before another in a slice: the click finds the very point.
    assert seen["good"]["picked"] == good
    check_panel(seen["good"], data, "kr60-3")
    assert seen["bad"]["picked"] == bad
    assert "out of reach" in seen["bad"]["flags"]
    assert {row[1] for row in seen["bad"]["values"]} == {"–"}
    assert seen["bad"]["budget"] == []
    assert seen["kept"]
    assert seen["without"]
    assert not seen["hiddenNote"]
    assert seen["line"] == [int(data.reached[data.layout.indices(slice(None))[0] == 3].sum()), True]


def test_a_slice_of_a_box_on_small_and_large_screens(tmp_path: Path) -> None:
    data = kr60_box(300.0)
    description, model = arm("kr60-3")
    page = viewer_page(data, description, model, title="box")
    heights = data.layout.axes[0].values
    for size in ("500,800", "800,600", "3840,2160"):
        probe = """const wide = document.documentElement; out.over = wide.scrollWidth - wide.clientWidth;
          const a = shot(); set("cut0", 2); out.changed = shot() !== a; out.shown = V.counts().shown;
          out.words = document.querySelector("#cuts output").textContent; out.cells = $("cells").disabled;
          out.stage = [$("stage").clientWidth, $("stage").clientHeight]; $("leastButton").click(); out.least = panel();
          out.inside = V.placeOf(out.least.picked).every((v, k) => v > 0 && v < out.stage[k]);"""
        seen, console = probed(page, tmp_path, probe, size=size)
        assert console == ""
        assert seen["over"] <= 0
        assert seen["changed"]
        assert seen["shown"] == data.reached[data.layout.indices(slice(None))[0] == 2].sum()
        assert seen["words"] == f"{heights[2]:.0f} mm"
        assert not seen["cells"]
        assert min(seen["stage"]) > 250
        assert seen["inside"]
        check_panel(seen["least"], data, "kr60-3")


def test_maps_without_any_variety_are_drawn(tmp_path: Path) -> None:
    """One point, or one value everywhere, infinite ones, or none at all: no division by zero, no error."""
    data = joint_map("xr701", {"q2_deg": np.array([5.0])}, {"q3real_deg": 90.0, "q5_deg": 30.0})
    flat = kr60_box(500.0)
    for name, one in (("xr701", data), ("kr60-3", flat)):
        n = one.layout.n
        fields = {
            "none": Field(np.full(n, np.nan), "N/mm", "nothing"),
            "same": Field(np.full(n, 7.0), "", "the same"),
            "zero": Field(np.zeros(n), "", "zero"),
            "endless": Field(np.full(n, np.inf), "", "endless"),
            "no part": Field(np.full(n, -1.0), "", "no part", ("a", "b")),
        }
        page = viewer_page(replace(one, fields=fields, parts=(), shares=None), *arm(name), title="flat")
        probe = """out.shown = [0, 1, 2, 3, 4].map(k => { set("field", k); shot(); return V.counts().shown; });
          set("field", 1); V.pick(V.extremes(1, true)[0]); out.panel = panel(); out.budget = $("budgetPart").hidden;"""
        seen, console = probed(page, tmp_path, probe)
        assert console == ""
        reached = int(one.reached.sum())
        assert seen["shown"] == [0, reached, reached, 0, 0]
        assert seen["panel"]["head"] == 7.0
        assert seen["budget"]
