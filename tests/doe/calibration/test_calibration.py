"""Calibration files: stages, laws, priors, written models that are the calibrated ones, resuming, bad input."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from doe import Measurements, bundled_data, read_measurements, select_loads
from doe.calibration.run import run_campaign
from doe.certainty.left_out import leave_one_pose_out
from doe.certainty.uncertainty import certainty
from doe.estimation.campaign import campaign_of, parse_campaign
from doe.estimation.estimate import estimate_at
from doe.estimation.noise import Noise
from doe.estimation.problem import problem
from doe.model_file.applied import apply_estimates
from fem import ArmModel, build_model, deflection
from fem.elements.walls import wall_flexibilities
from fem.free.parameters import parameter
from fem.model import link_part
from fem.statics.loads import as_loaded
from meshes.array_cache import ArrayCache
from robots import ModelDescription, load_description
from robots.library.models import parse_description, to_toml

HEAD = 'schema = "stiffarm-calibration/1"\nrobot = "kr60-3"\ntitle = "test"\n'
J2 = '[[parameter]]\nname = "j2.stiffness"\n'


def _build(description: ModelDescription) -> ArmModel:
    return build_model(description)


def _made_up(description: ModelDescription, n: int = 12, noise: float = 0.0, seed: int = 0) -> Measurements:
    """Readings of all six components by a model, at random poses under random loads."""
    model = build_model(description)
    rng = np.random.default_rng(seed)
    low, high = model.robot.limits.T
    q = np.repeat(rng.uniform(0.7 * low, 0.7 * high, (n, 6)), 3, axis=0)
    wrench = np.hstack([rng.normal(size=(3 * n, 3)) * 300.0, rng.normal(size=(3 * n, 3)) * 30.0])
    at = as_loaded(model, q, wrench, np.tile(model.robot.T_flange_tool[:3, 3], (3 * n, 1)))
    moved = deflection(model, at.q, at.wrench, at.point)
    read = moved + noise * rng.normal(size=moved.shape)
    unknown = np.full(3 * n, np.nan)
    return Measurements(
        source="made up",
        sha256=f"{seed:064d}",
        q=q,
        wrench=wrench,
        displacement=read,
        point=np.full((3 * n, 3), np.nan),
        sigma=unknown,
        pose=tuple(f"P{k // 3}" for k in range(3 * n)),
        repeat=(None,) * (3 * n),
        phase=(None,) * (3 * n),
        step=unknown,
        row_numbers=tuple(range(2, 3 * n + 2)),
        extra={},
        notes=(),
    )


@pytest.fixture(scope="module")
def kuka() -> ModelDescription:
    return load_description("kr60-3")


EVERYTHING = (
    HEAD
    + """
[[parameter]]
name = "j2.stiffness"
[[parameter]]
name = "j3.rx"
[[parameter]]
name = "j3.tx"
[[parameter]]
name = "j4.rx-rz"
[[parameter]]
name = "base.ry"
[[parameter]]
name = "tool.ty"
[[parameter]]
name = "upper-arm.modulus"
[[parameter]]
name = "forearm.wall"
[[parameter]]
name = "j3.zero"
[[parameter]]
name = "load.x"
[[parameter]]
name = "load.tilt_y"
[[parameter]]
name = "point.z"
[[law]]
kind = "fourier"
joint = "j5"
input = "q5_deg"
order = 1
"""
)


def test_a_written_model_is_the_calibrated_one(kuka: ModelDescription) -> None:
    campaign = parse_campaign(EVERYTHING, "test")
    model = build_model(kuka)
    data = _made_up(kuka)
    parameters, laws = campaign.free(model)
    walls = wall_flexibilities(kuka, model, [parameter(model, "forearm.wall")])
    p = problem(model, data, parameters, laws, walls)
    values = {
        "j2.stiffness": 7e5,
        "j3.rx": 2e6,
        "j3.tx": 3e8,
        "j4.rx-rz": 1e-6,
        "base.ry": 2e7,
        "tool.ty": 4e6,
        "upper-arm.modulus": 9e10,
        "forearm.wall": 1.2 * parameters[7].value,
        "j3.zero": 0.01,
        "load.x": 0.02,
        "load.tilt_y": 0.03,
        "point.z": 0.04,
        "j5.law[0]": 11.0,
        "j5.law[1]": 0.3,
        "j5.law[2]": -0.2,
    }
    u = np.array([q.inner(values[q.name]) for q in p.parameters])
    # The coupling needs a bearing that gives way beside it, or the matrix is not passive.
    u_j4 = next(k for k, q in enumerate(p.parameters) if q.name == "j4.rx-rz")
    u[u_j4] = 0.0
    e = estimate_at(p, u, Noise((1e-5, 1e-5)), np.ones(len(p)), settled=True)
    written = apply_estimates(kuka, certainty(e, profiles=False).estimates, laws)
    again = build_model(parse_description(to_toml(written), "written"))
    point = np.tile(again.robot.T_flange_tool[:3, 3], (data.n, 1))
    at = as_loaded(again, data.q, data.wrench, point)
    found = deflection(again, at.q, at.wrench, at.point)[p.row, p.component]
    # The wall is interpolated (1e-6 of the forearm's part); all else is rounding.
    np.testing.assert_allclose(found, e.prediction, atol=2e-7 * np.abs(e.prediction).max())


def test_couplings_go_into_the_model_and_must_be_passive(kuka: ModelDescription) -> None:
    model = build_model(kuka)
    data = _made_up(kuka)
    free = campaign_of("kr60-3", ("j4.rx", "j4.rz", "j4.rx-rz")).free(model)[0]
    p = problem(model, data, free)
    for coupling, passive in ((5e-7, True), (3e-6, False)):
        e = estimate_at(p, np.array([1e-6, 1e-6, coupling]), Noise((1e-5, 1e-5)), np.ones(len(p)), settled=True)
        sure = certainty(e, profiles=False)
        if not passive:
            refuses("M002", "positive semi-definite", apply_estimates, kuka, sure.estimates)
            continue
        again = build_model(apply_estimates(kuka, sure.estimates))
        found = deflection(again, data.q, data.wrench)[p.row, p.component]
        np.testing.assert_allclose(found, e.prediction, atol=1e-11 * np.abs(e.prediction).max())


def test_stages_recover_what_made_the_readings(kuka: ModelDescription) -> None:
    truth = kuka
    for name, k in {"j2": 9e5, "j3": 7e5, "j5": 2e5}.items():
        joints = tuple(
            j.model_copy(update={"stiffness": j.stiffness.model_copy(update={"value": k, "unit": "N m/rad"})})  # type: ignore[union-attr]
            if j.name == name
            else j
            for j in truth.joint
        )
        truth = truth.model_copy(update={"joint": joints})
    data = _made_up(truth, noise=1e-6)
    text = HEAD + "".join(f'[[parameter]]\nname = "{j}.stiffness"\n' for j in ("j2", "j3", "j5"))
    text += '[[stage]]\nname = "first"\nparameters = ["j2.stiffness", "j3.stiffness", "j5.stiffness"]\nlevels = 5\n'
    by_levels = run_campaign(kuka, _build, data, parse_campaign(text, "test"))
    at_once = run_campaign(kuka, _build, data, campaign_of("kr60-3", ("j2.stiffness", "j3.stiffness", "j5.stiffness")))
    np.testing.assert_allclose(at_once.stages[0].estimate.values, [9e5, 7e5, 2e5], rtol=5e-3)
    # Levels end 0.1 % apart; the study weighs millimetres and milliradians alike.
    np.testing.assert_allclose(by_levels.stages[0].estimate.values, [9e5, 7e5, 2e5], rtol=2e-2)
    assert at_once.rms_mm == pytest.approx(1e-3, rel=0.2)
    again = build_model(at_once.description)
    np.testing.assert_allclose(
        deflection(again, data.q, data.wrench), deflection(at_once.model, data.q, data.wrench), rtol=1e-12
    )


@pytest.mark.slow
def test_a_run_that_was_stopped_goes_on_bit_for_bit(kuka: ModelDescription, tmp_path: Path) -> None:
    data = _made_up(kuka, noise=1e-5)
    names = ("j1.stiffness", "j2.stiffness", "j3.stiffness")
    text = HEAD + "".join(f'[[parameter]]\nname = "{n}"\n' for n in names)
    text += "".join(f'[[stage]]\nname = "{n}"\nparameters = ["{n}"]\n' for n in names)
    campaign, store = parse_campaign(text, "test"), ArrayCache(tmp_path)

    class StoppedError(Exception):
        pass

    said: list[str] = []

    def stop_after_two(line: str) -> None:
        said.append(line)
        if len(said) == 2:
            raise StoppedError

    with pytest.raises(StoppedError):
        run_campaign(kuka, _build, data, campaign, store=store, progress=stop_after_two)
    resumed = run_campaign(kuka, _build, data, campaign, store=store)
    whole = run_campaign(kuka, _build, data, campaign)
    for a, b in zip(resumed.stages, whole.stages, strict=True):
        np.testing.assert_array_equal(a.estimate.u, b.estimate.u)
        assert a.estimate.noise == b.estimate.noise
    assert to_toml(resumed.description) == to_toml(whole.description)


@pytest.mark.parametrize(
    ("wrong", "bad_readings"),
    [
        *((w, False) for w in ("spring", "springs swapped", "noise", "out of range", "not finite", "shape", "none")),
        *((w, True) for w in ("weights", "negative noise", "none")),
    ],
)
def test_what_is_resumed_is_an_estimate_from_these_readings(
    wrong: str, bad_readings: bool, kuka: ModelDescription, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Under the right key and with the right checksum: nothing but the readings tells."""
    data = _made_up(kuka, noise=1e-5)
    if bad_readings:
        displacement = data.displacement.copy()
        displacement[[3, 17], [0, 2]] += 3e-3
        data = replace(data, displacement=displacement)
    campaign, store = campaign_of("kr60-3", ("j2.stiffness", "j3.stiffness")), ArrayCache(tmp_path)
    first = run_campaign(kuka, _build, data, campaign, store=store)
    (file,) = tmp_path.iterdir()
    kept = store.get(file.stem)
    assert kept is not None
    # 300 standard deviations off; of good readings the noise of this fit makes one 5.
    assert bool((kept["weight"] < 1e-3).any()) == bad_readings
    u, noise, weight = kept["u"], kept["noise"], kept["weight"]
    contents = {
        "spring": {"u": u * np.array([1.0, 1.01])},
        "springs swapped": {"u": u[::-1]},
        "noise": {"noise": 1.2 * noise},
        "weights": {"weight": np.where(np.arange(len(weight)) % 3 == 0, 0.05, weight)},
        "out of range": {"u": -u},
        "negative noise": {"noise": -noise},
        "not finite": {"u": u * np.nan},
        "shape": {"u": u[:1]},
        "none": {},
    }
    store.put(file.stem, kept | contents[wrong])
    again = run_campaign(kuka, _build, data, campaign, store=store)
    assert again.stages[0].resumed == (wrong == "none")
    assert ("is damaged" in caplog.text) == (wrong != "none")
    np.testing.assert_array_equal(again.stages[0].estimate.u, first.stages[0].estimate.u)
    assert run_campaign(kuka, _build, data, campaign, store=store).stages[0].resumed


def test_the_measured_robot_gives_the_main_jobs_figures() -> None:
    description = load_description("xr701")
    model = build_model(description)
    data = select_loads(read_measurements(bundled_data("xr701"), model.robot), (650.0,))
    names = tuple(f"{j}.stiffness" for j in ("j2", "j3", "j4", "j5"))
    found = run_campaign(description, _build, data, campaign_of("xr701", names))
    assert found.rms_mm == pytest.approx(0.0537, abs=5e-5)
    error, _, reasons = leave_one_pose_out(found.stages[0].estimate)
    assert not reasons
    assert 1e3 * np.sqrt(np.mean(error**2)) == pytest.approx(0.074, abs=5e-4)
    status = {e.parameter.place: e.status for e in found.stages[0].certainty.estimates}
    assert status == {"j2": "determined", "j3": "determined", "j4": "one-sided", "j5": "at bound"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD, "nothing is set free"),
        (HEAD + '[[parameter]]\nname = "j2.stiffness"\n' * 2, "twice"),
        (
            HEAD + '[[parameter]]\nname = "j2.stiffness"\n[[stage]]\nname="a"\nparameters=["j9.stiffness"]\n',
            "j9.stiffness",
        ),
        (HEAD + '[[parameter]]\nname = "j2.stiffness"\nlover = 1\n', "unknown key"),
        (HEAD + '[[law]]\njoint="j2"\nkind="spline"\n', "spline|kind"),
        (
            HEAD + '[[parameter]]\nname = "a"\n[[parameter]]\nname="b"\n[[stage]]\nname="a"\nparameters=["a"]\n',
            "no stage",
        ),
    ],
)
def test_bad_files(text: str, message: str) -> None:
    refuses("F011", message, parse_campaign, text, "test")


def test_bad_numbers(kuka: ModelDescription) -> None:
    model = build_model(kuka)
    for lines, message in (
        ('name = "j9.stiffness"', "j9"),
        ('name = "j2.stiffness"\nlower = -5', "range"),
        ('name = "j2.zero"\nprior = { value = 0, factor = 2, source = "x" }', "sd"),
        ('name = "j2.stiffness"\nprior = { value = 0, factor = 2, source = "x" }', "above 0"),
    ):
        campaign = parse_campaign(HEAD + "[[parameter]]\n" + lines + "\n", "test")
        refuses("M001 M002", message, campaign.free, model)
    stage = (
        HEAD + '[[parameter]]\nname = "j2.stiffness"\n[[stage]]\nname="a"\nparameters=["j2.stiffness"]\nposes=["P99"]\n'
    )
    refuses("T009", "P99", run_campaign, kuka, _build, _made_up(kuka), parse_campaign(stage, "test"))


def _with_walls(description: ModelDescription, name: str, ratio: float) -> ModelDescription:
    data = description.model_dump(by_alias=True)
    link = next(one for one in data["link"] if one["name"] == name)
    for key in ("section", "section_end", "rim"):
        if link[key] is not None:
            link[key]["wall"]["value"] *= ratio
    return ModelDescription.model_validate(data)


def test_a_wall_is_interpolated_to_a_millionth(kuka: ModelDescription) -> None:
    model = build_model(kuka)
    wall = wall_flexibilities(kuka, model, [parameter(model, "forearm.wall")])["forearm"]
    link = next(one for one in kuka.link if one.name == "forearm")
    for ratio in (0.6, 1.0, 1.7):
        changed = _with_walls(kuka, "forearm", ratio)
        expected = link_part(changed, model, "forearm").element.flexibility
        t = link.section.wall.si * ratio
        F, dF = wall(t)
        size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        assert (np.abs(F - expected) / size).max() < 1e-6
        step = (wall(t * 1.0001)[0] - wall(t / 1.0001)[0]) / (2.0 * np.log(1.0001))
        assert (np.abs(dF - step) / size).max() < 1e-6
    np.testing.assert_array_equal(
        next(part for part in model.links if part.name == "forearm").element.flexibility,
        next(part for part in build_model(kuka).links if part.name == "forearm").element.flexibility,
    )
