"""The closing width found by trial: the smallest that gives one casing near the original, or figures of every trial."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from refusals import refuses

from meshes.surfaces import trials as surface_trials
from meshes.surfaces.checks import SurfaceFault
from meshes.surfaces.distance_grid import Grid, contour
from meshes.surfaces.link import GOOD, POOR_ANGLE_DEG, prepare_link, quality_words
from meshes.surfaces.remesh import NearestOn
from meshes.surfaces.rings import Interface
from meshes.surfaces.routes import ImportSettings
from meshes.surfaces.trials import TooFar, by_trial, methods, warning
from meshes.surfaces.wrap import Departure
from robots import InputError

SIZE_M = 0.02
Z = np.array([0.0, 0.0, 1.0])


def far(mm: float) -> TooFar:
    return TooFar("arm", Departure(0.001, 1e-3 * mm, 0.2), 2 * SIZE_M)


def scripted(*outcomes: Exception | str):
    """An attempt that fails or succeeds as told, and what it was asked."""
    asked: list[tuple[float, str, float]] = []

    def attempt(width: float, method: str, most: float) -> str:
        asked.append((round(width, 9), method, most))
        outcome = outcomes[len(asked) - 1]
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    return attempt, asked


@pytest.fixture(autouse=True)
def without_pymeshlab(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surface_trials.importlib.util, "find_spec", lambda name: None)


def test_the_smallest_width_that_is_near_enough_is_taken_and_the_others_are_told() -> None:
    attempt, asked = scripted(far(77.0), SurfaceFault("surface arm: 15 separate bodies", code="X004"), "casing")
    done, failed = by_trial("arm", SIZE_M, "grid", attempt)
    assert done == "casing"
    assert asked == [(0.04, "grid", 0.04), (0.12, "grid", 0.04), (0.24, "grid", 0.04)]
    assert str(failed[0]).startswith(
        "40 mm (grid): off by 77 mm at the 95 % quantile (77 mm where details are lost, 1 "
    )
    assert str(failed[1]) == "120 mm (grid): 15 separate bodies"


def test_where_pymeshlab_is_alpha_wrap_is_tried_before_a_wider_opening(monkeypatch: pytest.MonkeyPatch) -> None:
    assert methods("auto") == ("grid",)
    monkeypatch.setattr(surface_trials.importlib.util, "find_spec", lambda name: object())
    attempt, asked = scripted(far(77.0), "casing")
    by_trial("arm", SIZE_M, "auto", attempt)
    assert [one[:2] for one in asked] == [(0.04, "grid"), (0.04, "alpha")]
    assert methods("grid") == ("grid",)


def test_if_every_trial_fails_the_message_has_link_figures_and_the_width_to_ask_for() -> None:
    attempt, _ = scripted(
        SurfaceFault("surface arm: 2 bodies", code="X004", value="gap 0.3 m"), far(77.0), far(56.4), far(81.0)
    )
    caught = refuses("L005", "", by_trial, "arm", SIZE_M, "auto", attempt)
    message = str(caught)
    for words in (
        "surface arm: no closing width",
        "within two elements (40 mm)",
        "40 mm (grid): 2 bodies, gap 0.3 m",
        "120 mm (grid): off by 77",
        "240 mm (grid): off by 56.4",
        "800 mm (grid): off by 81",
        "--close-mm 240 takes the nearest of them, off by 56.4 mm, with a",
        "--rigid arm",
    ):
        assert words in message
    attempt, _ = scripted(*[SurfaceFault("surface arm: no room", code="X004")] * 4)
    refuses("L005", "--close-mm does not help up to 800", by_trial, "arm", SIZE_M, "auto", attempt)


def test_what_no_width_mends_is_said_at_once() -> None:
    attempt, asked = scripted(InputError("grid too large", code="X004"))
    refuses("X004", r"^grid too large", by_trial, "arm", SIZE_M, "auto", attempt)
    assert len(asked) == 1


def test_two_elements_of_departure_are_the_limit() -> None:
    assert warning(Departure(0.0399, 0.0399, 0.3), SIZE_M) == ()
    (line,) = warning(Departure(0.001, 0.0401, 0.3), SIZE_M)
    assert line.startswith("WARNING: off by 40.1 mm at the 95 % quantile")


def arrays(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def casting(wall: float) -> tuple[np.ndarray, np.ndarray]:
    """Like a cast base: a solid foot, and on it four thin walls, 0.25 m high, open at the top."""
    foot = trimesh.creation.box((0.16, 0.24, 0.16)).apply_translation([0, 0, 0.08])
    sides = [
        trimesh.creation.box((wall, 0.24, 0.25)).apply_translation([x * (0.08 - wall / 2), 0, 0.28]) for x in (1, -1)
    ]
    sides += [
        trimesh.creation.box((0.16, wall, 0.25)).apply_translation([0, y * (0.12 - wall / 2), 0.28]) for y in (1, -1)
    ]
    return arrays(trimesh.util.concatenate([foot, *sides]))


def settings(**changes: object) -> ImportSettings:
    usual = {"wall": 0.006, "youngs_modulus": 7e10, "poissons_ratio": 0.3, "target_size": 0.03, "wrap": "grid"}
    return ImportSettings(**(usual | changes))


@pytest.mark.slow
def test_thin_cast_walls_are_lost_only_with_a_warning_and_kept_by_a_wider_closure() -> None:
    ends = {"root": Interface(np.zeros(3), Z), "tip": Interface(0.4 * Z, Z, radius=0.08)}
    found = prepare_link("casting", *casting(0.004), ends, settings())
    assert any(line.startswith("closing width 60 mm (grid): off by") for line in found.report)
    assert found.figures.departure_m[0] <= 2 * 0.03
    # The walls stand up to 0.405 m: the casing is as high as they are, but for half a wall and an element's edge.
    assert found.mesh.nodes[:, 2].max() > 0.38
    asked = prepare_link("casting", *casting(0.004), {"root": ends["root"]}, settings(opening=0.06, expected_span=0.4))
    assert asked.mesh.nodes[:, 2].max() < 0.3
    assert any(line.startswith("WARNING: off by") for line in asked.report)


def test_too_much_of_the_volume_in_thin_parts_is_refused() -> None:
    # A box of 0.2 x 0.2 x 0.3 m and a plate with 18 % of its inside, too thin for elements of 30 mm.
    box = trimesh.creation.box((0.2, 0.2, 0.3)).apply_translation([0, 0, 0.15])
    plate = trimesh.creation.box((0.3, 0.02, 0.6)).apply_translation([0.2, 0, 0.3])
    ends = {"root": Interface(np.zeros(3), Z)}
    caught = refuses(
        "L004",
        r"1\d %|2\d %",
        prepare_link,
        "plated",
        *arrays(trimesh.util.concatenate([box, plate])),
        ends,
        settings(opening=0.06, expected_span=0.4, repair="wrap"),
    )
    assert "too thin for the wall and the elements" in str(caught)


def test_no_ring_names_the_link_too() -> None:
    box = trimesh.creation.box((0.2, 0.2, 0.3)).apply_translation([0, 0, 0.15])
    ends = {"root": Interface(np.zeros(3)), "tip": Interface(0.6 * Z)}
    refuses(
        "L006",
        "no ring found at interface tip of link elbow_2",
        prepare_link,
        "elbow_2",
        *arrays(box),
        ends,
        settings(target_size=0.05),
    )


def test_the_quality_line_says_poor_and_that_only_the_angle_is() -> None:
    assert quality_words(POOR_ANGLE_DEG) == GOOD
    assert quality_words(7.24).startswith("POOR for one reason only, a minimum angle of 7.2 deg below 10")


def test_contours_through_grid_points_have_no_edges_without_length() -> None:
    # A box whose sides lie on grid points, far from the origin: single precision must tell the corners apart.
    grid = Grid(np.array([0.3, 0.3, 0.3]), (21, 21, 21), 0.0025)
    place = np.abs(np.stack(np.meshgrid(*[np.arange(21.0) - 10.0] * 3, indexing="ij"))).sum(axis=0)
    nodes, faces = contour(grid, 0.0025 * (place - 6.0))
    edges = nodes[faces] - nodes[np.roll(faces, 1, axis=1)]
    assert np.linalg.norm(edges, axis=2).min() > 0.0


def test_an_edge_without_length_does_not_spoil_the_nearest_point() -> None:
    corner = np.array([[[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]])
    point = np.array([[0.02, 0.0, 0.01]])
    found = NearestOn(corner, np.array([[[0.02, 0, 0], [0.02, 0, 0]]]), 0.1).nearest_sharp(point)
    np.testing.assert_allclose(found, [[0.02, 0.0, 0.0]], atol=1e-15)  # round-off
