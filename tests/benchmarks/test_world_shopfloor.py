"""The shop floor, a world of other mechanics, agrees with the program where nothing is hidden."""

from __future__ import annotations

import csv
import io
from collections import Counter
from pathlib import Path

import numpy as np
import oracles
import pytest

from benchmarks.worlds.shared import source_of


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.mark.parametrize("name", ["kr60-3", "tx200", "xr701", "werft-7", "krume-5"])
def test_springs_alone_move_the_tool_as_the_program_has_it(name: str, rng: np.random.Generator) -> None:
    oracles.load("pinocchio")
    from benchmarks.worlds.shopfloor.arms import postures, robot, springs_only
    from benchmarks.worlds.shopfloor.law import random_poses, ranges
    from fem import build_model, deflection
    from robots import load_description

    arm, n = robot(name), 12
    springs = arm.nominal() * rng.uniform(0.5, 2.0, arm.dof)
    model = build_model(load_description(str(source_of(name))), links="rigid")
    model = model.with_springs(dict(zip(arm.names, springs.tolist(), strict=True)))
    q = np.radians(random_poses(rng, arm, ranges(rng, arm), n))
    wrench = np.hstack([rng.normal(0, 300, (n, 3)), rng.normal(0, 30, (n, 3))])
    ours = springs_only(postures(arm, q), np.arange(n), wrench, 1.0 / springs)
    theirs = deflection(model, q, wrench)
    np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-9 * np.abs(theirs).max())


@pytest.mark.parametrize(("name", "share"), [("kr60-3", 4e-3), ("tx200", 4e-3), ("werft-7", 1e-9), ("krume-5", 1e-9)])
def test_links_bend_as_the_program_has_them(name: str, share: float, rng: np.random.Generator) -> None:
    """Tapered ones to some thousandths: here integrals, there elements of constant section."""
    oracles.load("pinocchio")
    from benchmarks.worlds.shopfloor.arms import beams, postures, robot
    from fem import build_model, deflection
    from robots import load_description

    arm, n = robot(name), 8
    springs = dict(zip(arm.names, arm.nominal().tolist(), strict=True))
    described = load_description(str(source_of(name)))
    q, w = rng.uniform(-1, 1, (n, arm.dof)), rng.normal(0, 300, (n, 6))
    bent, rigid = (build_model(described, links=links).with_springs(springs) for links in ("beam", "rigid"))
    theirs = deflection(bent, q, w) - deflection(rigid, q, w)
    ours = np.zeros((n, 6))
    for beam in beams(name):
        x = postures(arm, q).parts[:, beam.body]
        ours += np.einsum("nij,jk,nlk,nl->ni", x, beam.flexibility, x, w)
    np.testing.assert_allclose(ours, theirs, atol=share * np.abs(theirs).max())


def test_the_urdf_of_an_arm_of_ours_is_the_same_arm(tmp_path: Path, rng: np.random.Generator) -> None:
    oracles.load("pinocchio")
    from benchmarks.worlds.shopfloor.arms import robot, urdf
    from fem import build_model, deflection
    from robots import load_description

    arm = robot("krume-5")
    (tmp_path / "model.urdf").write_text(urdf(arm), encoding="utf-8")
    springs = dict(zip(arm.names, arm.nominal().tolist(), strict=True))
    q, w = rng.uniform(-1, 1, (5, arm.dof)), rng.normal(0, 200, (5, 6))
    d = [
        deflection(build_model(load_description(str(path)), links="rigid").with_springs(springs), q, w)
        for path in (source_of("krume-5"), tmp_path / "model.urdf")
    ]
    np.testing.assert_allclose(d[0], d[1], rtol=1e-9, atol=1e-12)


def test_bouc_wen_in_closed_form_is_its_differential_equation() -> None:
    oracles.load("pinocchio")
    from benchmarks.worlds.shopfloor.joint_laws import held_back

    turns = np.array([0.0, 300.0, 40.0, 250.0, -200.0, 0.0])
    z, at, ends = 0.0, 0.0, []
    for t in turns:
        for _ in range(20000):
            step = (t - at) / 20000
            limit = 130.0 if step > 0 else 90.0
            z += 0.9 * step * (1.0 - abs(z) / limit if z * step > 0 else 1.0)
        at = t
        ends.append(z)
    np.testing.assert_allclose(held_back(turns, 0.9, (130.0, 90.0)), ends, atol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["single", "outside"])
def test_every_effect_does_something(kind: str) -> None:
    oracles.load("pinocchio")
    from benchmarks.worlds.shopfloor import cases
    from benchmarks.worlds.shopfloor.cases import displacement

    for i in range(len(cases.families(cases.CATALOGUE if kind == "single" else cases.OUTSIDE))):
        most = 0.0
        for attempt in range(6):
            case = cases.draw(5, kind, i, attempt)
            q, truth = np.radians(case.q_deg), case.truth
            gone = truth.plain([]) if not truth.hides("load-path") else truth.plain()
            most = max(
                most, float(np.abs(displacement(truth.plain(), q, case.line) - displacement(gone, q, case.line)).max())
            )
        assert most > 2e-6 or truth.hides("load-path"), truth.hidden[0].code


@pytest.mark.slow
def test_every_family_has_its_turn() -> None:
    oracles.load("pinocchio")
    from benchmarks.worlds.shopfloor import cases

    for kind, laws in (("single", cases.CATALOGUE), ("outside", cases.OUTSIDE)):
        names = cases.families(laws)
        found = Counter(
            case.truth.hidden[0].law.family for i in range(len(names)) for case in [cases.draw(5, kind, i, 0)]
        )
        assert found == Counter(names)
    assert len(cases.families(cases.CATALOGUE)) == 28
    assert len(cases.families(cases.OUTSIDE)) >= 8


def test_factors_are_balanced() -> None:
    oracles.load("pinocchio")
    from benchmarks.worlds.shopfloor import cases

    tags = [cases.draw(2, "none", i, 0).tags | {"n": i} for i in range(30)]
    assert Counter(t["poses"] for t in tags) == {9: 10, 27: 10, 81: 10}
    assert Counter(t["reads"] for t in tags) == {"z": 15, "xyz": 15}
    assert len(Counter(t["robot"] for t in tags)) == 5


@pytest.mark.parametrize("index", range(6))
def test_springs_alone_leave_nothing(index: int) -> None:
    oracles.load("pinocchio")
    from benchmarks.worlds.shopfloor import cases

    assert cases.loudness(cases.draw(1, "none", index, 0)) < 1e-12


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    oracles.load("pinocchio")
    from benchmarks.worlds.shopfloor import make

    out = tmp_path_factory.mktemp("shopfloor")
    assert len(make(out, 4, single=4, none=2, outside=3, pairs=2)) == 11
    return out


def test_a_sheet_is_filled_in_by_the_same_truth(made: Path) -> None:
    """Readings of the first campaign, asked for again, agree within their noise; another visit has other noise."""
    from benchmarks.worlds.shopfloor import fill
    from benchmarks.worlds.shopfloor.sets import case_of

    for folder in sorted(made.glob("none-*")):
        text = (folder / "readings.csv").read_text(encoding="utf-8")
        rows = table(text)
        first = {r["pose"] for r in rows[:1]} | {rows[-1]["pose"]}
        asked = [r | {k: "" for k in r if k.startswith("d") and k.endswith("_mm")} for r in rows if r["pose"] in first]
        out = io.StringIO()
        writer = csv.DictWriter(out, list(asked[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(asked)
        filled = table(fill(folder, out.getvalue(), 1))
        assert [(r["pose"], r["fz_N"]) for r in filled] == [(r["pose"], r["fz_N"]) for r in asked]
        assert fill(folder, out.getvalue(), 1) == fill(folder, out.getvalue(), 1)
        assert fill(folder, out.getvalue(), 2) != fill(folder, out.getvalue(), 1)
        assert float(filled[0]["time_s"]) > float(rows[-1]["time_s"])
        case = case_of(folder)
        before = np.array([float(r["dz_mm"]) for r in rows if r["pose"] in first])
        after = np.array([float(r["dz_mm"]) for r in filled])
        # Outliers, days and scatter apart, the two differ by noise.
        allowed = 0.03 + 0.06 * np.abs(before) + 6e3 * (case.noise.days + max(case.noise.axes))
        assert np.median(np.abs(after - before) / allowed) < 0.5


def test_a_sheet_that_this_hall_cannot_measure_is_refused(made: Path) -> None:
    from benchmarks.worlds.shopfloor import fill

    with pytest.raises(ValueError, match="mx_Nm"):
        fill(made / "none-000", "pose,fz_N,mx_Nm,dz_mm\n1,-100,5,\n", 1)
    with pytest.raises(ValueError, match="no rows"):
        fill(made / "none-000", "pose,fz_N,dz_mm\n", 1)
