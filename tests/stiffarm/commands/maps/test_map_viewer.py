"""The map's page as it is written: it needs nothing else, holds the map's numbers, and its robot is the model's."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from viewer_maps import arm, joint_map, kr60_box, map_of, xr701_sweep

from robots import InputError, forward_kinematics, singularity_distance
from robots.constants import M_TO_MM, NORMAL_95
from robots.kinematics import moving_frames
from stiffarm.commands.maps import viewer as map_viewer
from stiffarm.commands.maps.viewer import column, single, thinned, viewer_data, viewer_page
from stiffarm.pages.robot_drawing import draw_robot, framed_bodies
from surrogate.maps.data import Axis, Field, Layout, MapData
from surrogate.maps.quantities import NEAR_SINGULAR

HOSTILE = "<script>alert('x')</script> {{ 7 * 7 }} </title>"
ROBOTS = ("xr701", "kr60-3", "tx200")


def unpacked(packed: dict[str, str]) -> NDArray[Any]:
    """A column as the page reads it."""
    values = np.frombuffer(base64.b64decode(packed["data"]), dtype=f"<{packed['kind']}")
    if "table" not in packed:
        return values
    return np.frombuffer(base64.b64decode(packed["table"]), dtype="<f8")[values]


def small_map() -> MapData:
    q2, q3 = np.linspace(-30.0, 40.0, 4), np.linspace(50.0, 110.0, 5)
    return joint_map("xr701", {"q4_deg": np.array([-20.0, 35.0]), "q2_deg": q2, "q3real_deg": q3}, {"q5_deg": 25.0})


def hostile(data: MapData) -> MapData:
    fields = {f"{HOSTILE}{k}": replace(f, label=f"{f.label} {HOSTILE}") for k, f in enumerate(data.fields.values())}
    return replace(data, fields=fields, metadata={HOSTILE: HOSTILE})


# --- what is written into the page ---


def test_the_page_needs_nothing_else_and_runs_nothing_of_a_file() -> None:
    description, model = arm("xr701")
    evil = description.model_copy(update={"title": HOSTILE})
    page = viewer_page(hostile(small_map()), evil, model, title=HOSTILE)
    assert "<script>alert" not in page
    assert "<title>&lt;script&gt;" in page
    assert "49" not in re.sub(r'<script type="application/json".*', "", page, flags=re.DOTALL).split("<body>")[1]
    assert not re.search(r"""(src|href)\s*=|url\(|import\s|fetch\(|XMLHttpRequest|innerHTML""", page)
    assert "default-src 'none'" in page
    assert page.count("</script>") == 2
    assert page.count("https://") + page.count("http://") == 0


def test_columns_keep_what_is_shown() -> None:
    generator = np.random.default_rng(3)
    values = 10.0 ** generator.uniform(-8.0, 8.0, 20_000)
    # Numbers just beside a tie of the last digit, which rounding to float32 pushes to the other side.
    ties = (generator.integers(10_000, 99_999, 2000) + 0.5) * (1.0 + generator.uniform(-1e-9, 1e-9, 2000))
    values = np.concatenate([values, -ties, ties * 1e-3, [0.0, np.nan, np.inf]])
    stored = single(values)
    assert any(f"{float(np.float32(a)):.4e}" != f"{a:.4e}" for a in values)
    assert all(f"{float(b):.4e}" == f"{a:.4e}" for a, b in zip(values, stored, strict=True))
    # The nudge is one unit in the last place of a float32, or two.
    np.testing.assert_allclose(stored[:-3], values[:-3], rtol=2.5e-7)


def test_few_distinct_values_are_stored_in_full() -> None:
    values = np.radians(np.tile(np.linspace(-35.0, 45.0, 300), 40))
    values[7] = np.nan
    packed = column(values)
    assert packed["kind"] == "u2"
    np.testing.assert_array_equal(unpacked(packed), values)
    assert column(values[:200])["kind"] == "u1"


def test_the_data_are_the_maps() -> None:
    data = xr701_sweep(4)
    page = viewer_data(data, *arm("xr701"))
    np.testing.assert_allclose(np.stack([unpacked(c) for c in page["points"]], axis=1), data.points, atol=3e-7)
    np.testing.assert_array_equal(np.stack([unpacked(c) for c in page["q"]], axis=1), data.q)
    assert data.shares is not None
    names = [part["name"] for part in page["parts"]]
    assert set(names) <= set(data.parts)
    shares = np.frombuffer(base64.b64decode(page["shares"]), dtype="<u2").reshape(data.layout.n, -1)
    kept = data.shares[:, [data.parts.index(n) for n in names]]
    # Stored in tenths of a per cent.
    np.testing.assert_allclose(shares[data.reached] / 1000.0, kept[data.reached], atol=5.0001e-4)
    assert (shares[~data.reached] == 0xFFFF).all()
    left_out = [i for i, n in enumerate(data.parts) if n not in names]
    assert (data.shares[data.reached][:, left_out] < 5e-4).all()


def test_poses_near_a_singularity_are_flagged() -> None:
    data = xr701_sweep(5)  # q5 = 0 is among its values
    robot = arm("xr701")[1].robot
    page = viewer_data(data, *arm("xr701"))
    near = np.frombuffer(base64.b64decode(page["near_singular"]), dtype=np.uint8) == 1
    wanted = np.zeros(data.layout.n, dtype=bool)
    wanted[data.reached] = singularity_distance(robot, data.q[data.reached]).sigma_min < NEAR_SINGULAR
    np.testing.assert_array_equal(near, wanted)
    assert 0 < near.sum() < data.reached.sum()
    own = Field(np.where(data.reached, 0.0, -1.0), "", "near a singular pose", ("no", "yes"))
    page = viewer_data(replace(data, fields={**data.fields, "near_singular": own}), *arm("xr701"))
    assert not np.frombuffer(base64.b64decode(page["near_singular"]), dtype=np.uint8).any()


def test_the_maps_own_uncertainty_becomes_the_error_bar() -> None:
    data = small_map()
    own = Field(np.full(data.layout.n, 0.5), "percent", "standard uncertainty of the stiffness")
    page = viewer_data(replace(data, fields={**data.fields, "uncertainty_percent": own}), *arm("xr701"))
    np.testing.assert_allclose(unpacked(page["error"]), NORMAL_95 * 0.005, rtol=1e-15)
    assert page["error_of"] == 0
    assert viewer_data(data, *arm("xr701"))["error"] is None


@pytest.mark.parametrize(("shape", "most"), [((40, 30, 50), 7000), ((7, 1000), 900), ((3, 3), 100), ((1000,), 10)])
def test_large_maps_are_thinned_evenly(shape: tuple[int, ...], most: int) -> None:
    layout = Layout("box", tuple(Axis("zyx"[k], "mm", np.arange(m) * 10.0) for k, m in enumerate(shape)))
    number = Field(np.arange(float(layout.n)), "", "number")
    points, reached = np.zeros((layout.n, 3)), np.ones(layout.n, dtype=bool)
    data = thinned(MapData(layout, points, np.zeros((layout.n, 0)), reached, (), {"number": number}), most)
    kept, numbers = data.layout, data.fields["number"].values.astype(int)
    assert kept.n == len(numbers) <= most
    assert kept.n > most / 3 or kept.n == layout.n
    grid = np.stack(np.unravel_index(numbers, layout.shape))
    for axis, whole, indices in zip(kept.axes, layout.axes, grid.reshape(len(shape), -1), strict=True):
        assert len(set(np.diff(axis.values))) <= 1
        np.testing.assert_array_equal(np.unique(whole.values[indices]), axis.values)
        # Both ends lose alike: what is left out on the two sides differs by one step of the map at most.
        lost = (axis.values[0] - whole.values[0]) - (whole.values[-1] - axis.values[-1])
        assert abs(lost) <= 10.0


def test_a_thinned_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    data, (description, model) = small_map(), arm("xr701")
    assert "evenly thinned" not in viewer_page(data, description, model, title="all")
    monkeypatch.setattr(map_viewer, "thinned", lambda data: thinned(data, 20))
    page = viewer_page(data, description, model, title="some")
    assert "This page holds 12 of the map&#39;s 40 points, evenly thinned: " in page


@pytest.mark.slow
def test_a_page_of_a_hundred_thousand_points_is_below_15_megabytes() -> None:
    data, (description, model) = kr60_box(40.0), arm("kr60-3")
    more = 100_000 / data.layout.n
    page = viewer_page(data, description, model, title="large")
    assert len(page) * more < 15e6


# --- the robot ---


@pytest.mark.parametrize("name", ROBOTS)
def test_bodies_move_as_the_drawing_does(name: str) -> None:
    """Bodies carried by their frames are where the drawing of that pose has them."""
    description, model = arm(name)
    robot = model.robot
    bodies = framed_bodies(description, robot)
    generator = np.random.default_rng(11)
    for q in generator.uniform(*robot.limits.T, (4, robot.dof)):
        R, p = moving_frames(robot, q[None])
        drawn = draw_robot(description, robot, q)
        assert [b.name for b in bodies] == [d.name for d in drawn]
        for body, there in zip(bodies, drawn, strict=True):
            placed = body.mesh.vertices @ R[0, body.frame].T + p[0, body.frame]
            wanted = np.asarray(there.mesh.vertices) / M_TO_MM
            if body.name == robot.joint_names[-1]:
                continue  # The drawing turns this hub with the bend of the wrist.
            # A circle's corners may lie elsewhere on it: 32 sides on the largest radius, 0.3 m, leave 1.4 mm.
            np.testing.assert_allclose(placed.min(axis=0), wanted.min(axis=0), atol=2.5e-3)
            np.testing.assert_allclose(placed.max(axis=0), wanted.max(axis=0), atol=2.5e-3)


def test_a_robot_without_sections_gets_rods() -> None:
    description, model = arm("kr60-3")
    bare = description.model_copy(update={"link": ()})
    rods = [b for b in framed_bodies(bare, model.robot) if b.name.startswith("rod ")]
    assert len(rods) >= 4
    assert {b.frame for b in rods} <= set(range(model.robot.dof + 2))


# --- bad input ---


def test_bad_input_is_refused() -> None:
    data, (description, model) = small_map(), arm("xr701")
    other, other_model = arm("tx200")
    with pytest.raises(InputError, match="joint coordinates of the m"):
        viewer_page(data, other, other_model, title="t")
    with pytest.raises(InputError, match="joint coordinates of the model"):
        viewer_page(data, description, other_model, title="t")
    with pytest.raises(InputError, match="reaches"):
        viewer_page(replace(data, reached=np.zeros(data.layout.n, dtype=bool)), description, model, title="t")
    with pytest.raises(InputError, match="quantities"):
        viewer_page(replace(data, fields={}), description, model, title="t")


def test_maps_of_one_point_and_of_one_value_are_drawn() -> None:
    """Constant quantities, one point, no shares: nothing divides by zero on the Python side."""
    _, model = arm("xr701")
    q = np.radians([[0.0, 5.0, 90.0, 0.0, 30.0, 0.0]])
    frames = forward_kinematics(model.robot, q)
    layout = Layout("joints", (Axis("q2_deg", "deg", np.array([5.0])),))
    data = replace(map_of("xr701", layout, frames.p_flange, q, np.array([True])), parts=(), shares=None)
    page = viewer_data(data, *arm("xr701"))
    assert page["n"] == 1
    assert page["parts"] == []
    assert page["shares"] == ""
