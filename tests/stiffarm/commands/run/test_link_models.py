"""Two link models beside each other: figures, shares, agreement of springs, and what the sentences make of them."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from doe import bundled_campaign, bundled_data, read_measurements, select_loads
from fem import build_model, compliance
from robots import load_description
from stiffarm.commands.run import link_models, payload
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.link_models import LinkModels, Pair, SpringPair
from stiffarm.commands.run.story.links import links_section, sentences, signed
from stiffarm.pages.report import Table
from stiffarm.session import inputs

GIVEN = inputs.read_model("xr701", "beam", None)
DATA = read_measurements(bundled_data("xr701"), GIVEN.robot)
SCHEME = bundled_campaign("xr701")
BEST = "constant, parallelogram"
INF, NAN = float("inf"), float("nan")


@pytest.fixture(scope="module")
def both() -> LinkModels:
    assert SCHEME is not None
    kinds = (GIVEN, inputs.with_links(GIVEN, "rigid"))
    return LinkModels(*(link_models.calibrate(link_models.by_load_path(one), DATA, SCHEME) for one in kinds))


def shifted(both: LinkModels, left_out_mm: float) -> LinkModels:
    """The own links beside themselves, but with another left-out error of the recommended calibration."""
    variants = tuple(
        replace(v, left_out=v.left_out * (1.0 + left_out_mm / v.left_out_rms_mm)) if v.name == BEST else v
        for v in both.own.variants
    )
    return LinkModels(replace(both.own, variants=variants), both.own)


@pytest.mark.slow
def test_both_kinds_reach_their_errors(both: LinkModels) -> None:
    # Agreed when the chain was built, quoted rounded: half of the last digit. (RMS, left-out RMS) in mm.
    wanted = {
        ("beam", "constant, parallelogram"): (0.0537, 0.0742),
        ("beam", "constant, serial"): (0.0980, 0.1349),
        ("beam", "staged, parallelogram"): (0.0428, 0.0966),
        ("beam", "staged, serial"): (0.0453, 0.1486),
        ("rigid", "constant, parallelogram"): (0.0503, 0.0700),
        ("rigid", "constant, serial"): (0.0964, 0.1325),
    }
    found = {
        (side.links, v.name): (v.found.rms_mm, v.left_out_rms_mm)
        for side in (both.own, both.other)
        for v in side.variants
    }
    assert len(found) == 8
    for key, errors in wanted.items():
        assert found[key] == pytest.approx(errors, abs=5.1e-5), key


def test_the_structures_share_is_what_it_adds_to_the_deflection(both: LinkModels) -> None:
    """Under a force the share in the energy is that in the tool's motion along it: known from the equations."""
    for variant in both.own.variants:
        alone = both.own.alone_mm[variant.model.load_path]
        # Round-off of two ways to the same sum.
        assert both.own.share[variant.name] == pytest.approx(alone / variant.predicted_mm, rel=1e-9)
        assert both.own.share[variant.name].min() > 0.02
        assert not both.other.share[variant.name].any()
    assert not any(alone.any() for alone in both.other.alone_mm.values())


def test_the_other_load_path_is_that_of_a_model_built_for_it() -> None:
    """Links are taken over, not built again; either way round."""
    q = np.radians([[10.0, 5.0, 77.5, 30.0, -40.0, 0.0]])
    for first, second in (("parallelogram", "serial"), ("serial", "parallelogram")):
        one = inputs.with_load_path(inputs.read_model("xr701", "beam", first), second)  # type: ignore[arg-type]
        fresh = build_model(load_description("xr701"), "beam", second)  # type: ignore[arg-type]
        assert one.model.load_path == second
        assert np.array_equal(compliance(one.model, q), compliance(fresh, q))


def test_a_calibrated_model_is_that_of_its_description(both: LinkModels) -> None:
    q = np.radians([[0.0, 5.0, 77.5, 30.0, -40.0, 0.0]])
    for variant in both.own.variants:
        fresh = build_model(variant.description, "beam")
        assert fresh.load_path == variant.model.load_path
        assert compliance(variant.model, q) == pytest.approx(compliance(fresh, q), rel=1e-12, abs=1e-25)  # round-off


@pytest.mark.parametrize(
    ("own", "other", "agreement"),
    [
        ((2.0, 1.0, 3.0), (2.5, 1.5, 3.5), "within"),
        ((2.0, 1.0, 3.0), (3.2, 1.5, 3.5), "outside"),  # the other value is above the own interval
        ((1.2, 1.0, 3.0), (2.5, 1.5, 3.5), "outside"),  # the own value is below the other interval
        ((2.0, 1.0, INF), (9e8, 1.5, INF), "within"),
        ((1e9, 2.5, INF), (2.0, 1.0, 3.0), "outside"),
        ((NAN, NAN, NAN), (2.0, 1.0, 3.0), "unknown"),
        ((2.0, NAN, INF), (2.0, 1.0, INF), "unknown"),
    ],
)
def test_springs_agree_if_each_lies_in_the_others_interval(
    own: tuple[float, float, float], other: tuple[float, float, float], agreement: str
) -> None:
    assert SpringPair("j2", own, other).agreement == agreement
    assert SpringPair("j2", other, own).agreement == agreement


def test_a_spring_at_a_bound_has_no_change() -> None:
    assert SpringPair("j2", (1.1e6, 1e6, 2e6), (1e6, 1e6, 2e6)).change == pytest.approx(0.1)
    assert SpringPair("j2", (1.1e6, 1e6, 2e6), (1e6, 1e6, 2e6)).has_values
    for bound in (1e9, 1e3, NAN):
        assert not SpringPair("j2", (1.1e6, 1e6, 2e6), (bound, 1e6, INF)).has_values
    assert [signed(v) for v in (0.0, -0.0004, -0.0006, 0.123, 4.0)] == [
        "0.0\u00a0%",
        "0.0\u00a0%",
        "−0.1\u00a0%",
        "+12\u00a0%",
        "+400\u00a0%",
    ]


def test_poses_are_counted_once_and_only_where_both_predict() -> None:
    def variant(*error: float) -> SimpleNamespace:
        return SimpleNamespace(pose=("a", "a", "b", "c"), left_out=np.array(error))

    # Pose a: 1 + 1 against 4 + 0; b: worse; c: not predicted by one of them.
    pair = Pair(variant(1, 1, 2, 1), variant(2, 0, 1, NAN), ())  # type: ignore[arg-type]
    assert pair.poses_better() == (1, 2)


def findings(both: LinkModels) -> Findings:
    """As much of them as the section on links reads."""
    best = next(v for v in both.own.variants if v.name == BEST)
    return SimpleNamespace(best_variant=best, scheme=SCHEME)  # type: ignore[return-value]


def test_the_sentences_of_equal_links_say_that_they_are_alike(both: LinkModels) -> None:
    same = shifted(both, 0.0)
    assert "cannot distinguish beams from beams" in sentences(same, BEST, 0.01)[-1]
    *_, springs, _ = links_section(findings(same), same).blocks
    assert isinstance(springs, Table)
    assert {row[6] for row in springs.rows} <= {"0.0\u00a0%", "–"}
    assert {row[7] for row in springs.rows} <= {"yes", "no interval"}


def test_the_sentences_name_the_better_links(both: LinkModels) -> None:
    worse, better = (
        sentences(replace(shifted(both, by), other=replace(both.own, links="rigid")), BEST, 0.01)
        for by in (0.03, -0.03)
    )
    assert "rigid links predict better by 0.030 mm" in worse[-1]
    assert "beams predict better by 0.030 mm" in better[-1]
    assert "0.044 mm, constant, parallelogram with beams" in better[-1]


def test_beams_beside_rigid_links(both: LinkModels) -> None:
    alone, verdict = sentences(both, BEST, 0.01)
    assert "beams alone deflect 0.060 to 0.120 mm" in alone
    assert "rigid links do not deflect" in alone
    assert "cannot distinguish beams from rigid links" in verdict
    _, _, errors, springs, _ = links_section(findings(both), both).blocks
    assert isinstance(errors, Table)
    assert isinstance(springs, Table)
    best = errors.rows[errors.best]
    assert best[0] == BEST
    assert best[5:7] == ("0.0\u00a0%", "4.6 to 5.6\u00a0%")
    staged = next(row for row in errors.rows if row[0] == "staged, parallelogram")
    assert float(staged[3]) - float(staged[4]) == pytest.approx(0.032, abs=6e-4)
    assert staged[7] == "6 of 9"
    constant = {row[3]: row for row in springs.rows if row[0] == BEST}
    assert constant["j3"][6].startswith("+5.3")
    assert {row[7] for row in constant.values()} == {"yes"}
    outside = {(row[2], row[3]) for row in springs.rows if row[0] == "staged, parallelogram" and row[7] == "NO"}
    assert ("40", "j5") in outside
    assert "29 pairs that have one, 24 lie within" in springs.caption


def test_results_json_has_both_sides(both: LinkModels) -> None:
    content = json.loads(json.dumps(payload.link_models(both), allow_nan=False))
    assert (content["own"], content["beside"]) == ("beam", "rigid")
    one = next(c for c in content["calibrations"] if c["calibration"] == BEST)
    assert one["beam"]["left_one_pose_out_rms_mm"] == pytest.approx(0.0742, abs=5e-5)  # half of the last digit
    assert one["rigid"]["links_bar_and_crank_share"] == [0.0] * 9
    assert one["left_out_difference_mm"] == pytest.approx(0.0042, abs=5e-5)  # as above
    assert len(one["beam"]["poses"]) == one["poses_predicted"] == 9
    joints = {s["joint"]: s for s in one["springs"]}
    assert joints["j5"]["beam"]["k_Nm_per_rad"] is None, "a spring at its bound is no number"
    assert joints["j5"]["beam"]["interval_Nm_per_rad"][1] is None
    assert joints["j3"]["each_within_the_others_interval"] is True
    staged = next(c for c in content["calibrations"] if c["calibration"] == "staged, parallelogram")
    assert {(s["stage"], s["pose"]) for s in staged["springs"]} >= {("step 1", "5"), ("step 3", "75")}


@pytest.mark.slow
def test_shells_beside_beams() -> None:
    assert SCHEME is not None
    shell = inputs.with_links(GIVEN, "shell")
    assert shell.model.link_kind == "shell"
    sides = [
        link_models.calibrate(link_models.by_load_path(one), select_loads(DATA, SCHEME.loads_N), SCHEME)
        for one in (shell, GIVEN)
    ]
    compared = LinkModels(*sides)
    for a, b in zip(compared.own.variants, compared.other.variants, strict=True):
        # Links hold 3 to 7 % of the compliance and the casings agree with beams within a quarter of that, so the
        # errors of 0.04 to 0.15 mm can move by the gauge's digit at most.
        assert a.found.rms_mm == pytest.approx(b.found.rms_mm, abs=0.01), a.name
    for path, alone in compared.own.alone_mm.items():
        assert alone == pytest.approx(compared.other.alone_mm[path], rel=0.25)
        assert not np.array_equal(alone, compared.other.alone_mm[path])
    said = sentences(compared, BEST, SCHEME.noise.gauge_mm)
    assert "shells" in said[0]
    assert "beams" in said[0]
