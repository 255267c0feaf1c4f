import json
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from arm_cases import few_runs, sprung
from refusals import refuses

from fem.springs import FourierBasis, LawSpring
from robots import Robot, load_robot
from surrogate import compliance_matrix, scope_of, task_of, train
from surrogate.asking import query
from surrogate.designs import space_filling_design
from surrogate.error_bars import ParameterBars, learn_bars
from surrogate.fit import fit
from surrogate.model import SCHEMA, ErrorFigures, Quantity, Surrogate, predict, predict_compliance
from surrogate.scope import Couplings, Scope
from surrogate.storage import _checksum, load_surrogate, save_surrogate

LOWER, UPPER = np.array([-0.6, 0.7]), np.array([0.8, 2.0])


def compliance(Q):
    return 1e-6 * (1.3 + np.cos(Q[:, 0]) * np.sin(Q[:, 1]))


def make(basis="polynomial", target="logarithm"):
    """A surrogate with everything that a file may hold but a factor."""
    couplings = Couplings(
        ("sum", "forearm"), np.array([[1.0, 1.0], [1.0, -1.0]]), np.array([-np.inf, -2.2]), np.array([2.7, 0.05])
    )
    scope = Scope(
        robot="xr701",
        model_hash="0f" * 32,
        load_direction=(0.6, 0.0, -0.8),
        inputs=("q2_deg", "q3real_deg"),
        fixed_deg={"q1_deg": 0.1, "q4_deg": -12.3},
        lower=LOWER,
        upper=UPPER,
        couplings=couplings,
        periodic=(False, True),
    )
    Q = space_filling_design(LOWER, UPPER, 200, np.random.default_rng(0), couplings=couplings)
    found = fit(Q, compliance(Q), scope, basis, {"polynomial": 6, "trigonometric": 2, "adaptive": 6}[basis], target)
    fresh = space_filling_design(LOWER, UPPER, 300, np.random.default_rng(1), density="random", couplings=couplings)
    bars = learn_bars(found.basis, scope, Q, fresh, np.sin(1e3 * fresh[:, 0]))
    small = found.basis.take(np.arange(3))
    return Surrogate(
        **{f.name: getattr(scope, f.name) for f in fields(Scope)},
        quantity=Quantity("compliance", "m/N", "µ-compliance"),
        basis=basis,
        degree=found.basis.degree,
        target=target,
        expansion=found.basis.expansion(found.coefficients),
        errors=ErrorFigures(basis, 6, target, 3, 4, 5, *(0.1 / 3.0,) * 5, 0.95, 1e3 / 7.0, None, 0.2),
        bars=bars,
        parameters=ParameterBars(
            small.expansion(1e-8 * np.arange(6.0).reshape(3, 2)),
            ("j2", "j3"),
            0.01,
            ("j4",),
            small.expansion(np.array([0.1, 0.0, 0.0])),
        ),
        kinematics=load_robot("xr701"),
        fixed_influence={"q1_deg": 0.0, "q4_deg": 1.0 / 3.0},
        notes=("simulated", "größer als µ"),
    )


@pytest.fixture(scope="module")
def factored():
    """With a weight (a law), kinematics and a periodic input."""
    law = LawSpring(FourierBasis(1, 2), np.array([13.7, 0.3, -0.2, 0.1, 0.05]))
    model = sprung("kr60-3", j2=law)
    scope = scope_of(model.robot, "0" * 64, ("q2_deg", "q3_deg", "q4_deg"))
    task = task_of(model, scope, np.random.default_rng(0), notes=("a note",))
    with few_runs():
        return train(task, np.random.default_rng(0), basis="factored").best


def same(a, b, where):
    """Bit for bit, however deep. Kinematics come back without what singularities do not need."""
    if isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), where
    elif is_dataclass(a):
        assert type(a) is type(b)
        for f in fields(a):
            if not (isinstance(a, Robot) and f.name in ("couplings", "parallelogram")):
                same(getattr(a, f.name), getattr(b, f.name), f"{where}.{f.name}")
    elif isinstance(a, tuple):
        assert len(a) == len(b), where
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{where}[{i}]")
    else:
        assert (a, type(a)) == (b, type(a)) if not isinstance(a, float) else np.float64(a) == np.float64(b), where


def through_a_file(s, tmp_path):
    save_surrogate(s, tmp_path / "s.json")
    return load_surrogate(tmp_path / "s.json")


@pytest.mark.parametrize("basis", ["polynomial", "trigonometric", "adaptive"])
@pytest.mark.parametrize("target", ["direct", "logarithm"])
def test_a_surrogate_comes_back_bit_for_bit(tmp_path, basis, target):
    s = make(basis, target)
    back = through_a_file(s, tmp_path)
    same(s, back, "surrogate")
    Q = np.random.default_rng(2).uniform(LOWER, UPPER, (500, 2))
    # The surrogate is the same to the bit; what is computed with it rounds by where arrays lie in memory (BLAS).
    np.testing.assert_allclose(predict_compliance(back, Q), predict_compliance(s, Q), rtol=1e-12)
    a, b = query(s, Q, extrapolate=True), query(back, Q, extrapolate=True)
    for name in ("value", "relative_error", "model_error", "parameter_error", "singularity"):
        np.testing.assert_allclose(getattr(b, name), getattr(a, name), rtol=1e-9, err_msg=name)
    assert a.reachable.tolist() == b.reachable.tolist()
    assert b.reachable.tolist() == s.couplings.kept(Q).all(axis=1).tolist()
    assert np.isfinite(b.parameter_error[b.reachable]).all()


def test_a_matrix_comes_back_bit_for_bit(tmp_path, factored, rng):
    back = through_a_file(factored, tmp_path)
    same(factored, back, "surrogate")
    assert len(back.factor.weights) == 1
    Q = rng.uniform(factored.lower, factored.upper, (200, 3))
    # As above: round-off by where arrays lie in memory.
    C = compliance_matrix(factored, Q)
    np.testing.assert_allclose(compliance_matrix(back, Q), C, rtol=1e-12, atol=1e-14 * np.abs(C).max())
    d = np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(predict(back, Q, d), predict(factored, Q, d), rtol=1e-12)
    np.testing.assert_allclose(query(back, Q).singularity, query(factored, Q).singularity, rtol=1e-9)


def test_a_surrogate_that_knows_little_comes_back_too(tmp_path):
    s = replace(make(), bars=None, parameters=None, kinematics=None, fixed_influence={}, notes=())
    back = through_a_file(s, tmp_path)
    same(s, back, "surrogate")
    assert (back.bars, back.parameters, back.kinematics, back.factor) == (None, None, None, None)


def test_saving_twice_gives_the_same_bytes(tmp_path, factored):
    back = through_a_file(factored, tmp_path)
    save_surrogate(back, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "s.json").read_bytes()


def test_saving_leaves_one_strict_json_file_and_replaces_the_old_one(tmp_path):
    path = tmp_path / "s.json"
    path.write_text("old", encoding="utf-8")
    save_surrogate(make(), path)
    assert [p.name for p in tmp_path.iterdir()] == ["s.json"]
    data = json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert data["schema"] == SCHEMA == "stiffarm-surrogate/2"
    assert data["couplings"][0]["lower_rad"] is None


def test_a_failed_save_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "s.json"
    save_surrogate(make(), path)
    before = path.read_bytes()

    def fail(source, place):
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        save_surrogate(make("trigonometric"), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["s.json"]


@pytest.fixture(scope="module")
def good(tmp_path_factory, factored):
    """What two good files hold, as text."""
    folder = tmp_path_factory.mktemp("good")
    out = {}
    for name, s in (("plain", make("trigonometric")), ("factored", factored)):
        save_surrogate(s, folder / name)
        out[name] = (folder / name).read_text(encoding="utf-8")
    return out


def edited(tmp_path, text, change, seal=True):
    """Write a surrogate file with a change, its checksum made to fit if ``seal``."""
    path = tmp_path / "s.json"
    data = json.loads(text)
    change(data)
    if seal:
        data["content_sha256"] = _checksum(data)
    path.write_text(json.dumps(data), encoding="utf-8")
    return path


def test_layout_may_change_but_content_may_not(tmp_path, good):
    load_surrogate(edited(tmp_path, good["plain"], lambda data: None, seal=False))

    def nudge(data):
        row = data["expansion"]["coefficients"][3]
        row[0] = float(np.nextafter(row[0], 1.0))

    refuses(
        "F007",
        r"does not fit its checksum.*changed.*fit the surrogate again",
        load_surrogate,
        edited(tmp_path, good["plain"], nudge, seal=False),
    )
    refuses(
        "F011", "content_sha256", load_surrogate, edited(tmp_path, good["plain"], drop("content_sha256"), seal=False)
    )
    # The same edit with a fitting checksum loads: it was the checksum that noticed it.
    load_surrogate(edited(tmp_path, good["plain"], nudge))


def numbers(data, path=()):
    """Paths of all scalars in a file."""
    if isinstance(data, dict):
        return [p for key, value in data.items() for p in numbers(value, (*path, key))]
    if isinstance(data, list):
        return [p for i, value in enumerate(data) for p in numbers(value, (*path, i))]
    return [path]


def set_to(*keys, value):
    def change(data):
        for key in keys[:-1]:
            data = data[key]
        data[keys[-1]] = value

    return change


@pytest.mark.parametrize("which", ["plain", "factored"])
def test_any_scalar_changed_by_hand_is_noticed(tmp_path, good, which, rng):
    data = json.loads(good[which])
    paths = [p for p in numbers(data) if p != ("content_sha256",)]
    for i in rng.choice(len(paths), 25, replace=False):
        path = paths[i]
        value = data
        for key in path:
            value = value[key]
        other = {bool: lambda v: not v, int: lambda v: v + 1, float: lambda v: v * 1.001 + 1e-9, str: lambda v: v + "x"}
        new = 7.0 if value is None else other[type(value)](value)
        refuses(
            "F007 F011",
            r"surrogate file",
            load_surrogate,
            edited(tmp_path, good[which], set_to(*path, value=new), seal=False),
        )


def drop(*keys):
    def change(data):
        for key in keys[:-1]:
            data = data[key]
        data.pop(keys[-1])

    return change


E = "expansion"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (set_to("schema", value="stiffarm-surrogate/7"), f"newer.*surrogate/7.*allowed: {SCHEMA}.*update"),
        (set_to("schema", value="stiffarm-surrogate/1"), f"surrogate/1.*allowed: {SCHEMA}.*fit the surrogate again"),
        (set_to("schema", value="something-else/1"), f"something-else/1.*allowed: {SCHEMA}"),
        (set_to("schema", value=2), f"allowed: {SCHEMA}"),
        (drop("schema"), f"schema.*allowed: {SCHEMA}"),
        (set_to(E, "coefficients", 0, value=[float("nan")]), "not valid JSON.*NaN"),
        (set_to(E, "coefficients", 0, value=[float("-inf")]), "not valid JSON.*Infinity"),
        (set_to(E, "coefficients", 0, value=["1"]), r"expansion.coefficients.0.0"),
        (drop(E, "coefficients", 3), "coefficients.*one row for each term"),
        (drop(E, "terms", 3), "coefficients.*one row for each term"),
        (set_to(E, "terms", 0, value=[0, 9]), "functions that the families have"),
        (set_to(E, "terms", 0, value=[0, -1]), "functions that the families have"),
        (set_to(E, "terms", 0, value=[0]), "rows of one length"),
        (set_to(E, "terms", 0, value=[0.5, 0]), r"expansion.terms.0.0"),
        (set_to(E, "terms", 0, value=[10**30, 0]), "beyond 64 bits"),
        (set_to(E, "terms", 0, value=[10**400, 0]), "beyond 64 bits"),
        (set_to(E, "terms", value=[]), "surrogate: terms"),
        (lambda d: d[E]["terms"].reverse(), "sorted by rows"),
        (drop(E, "families", 0), r"\(t, 1\)|one of 2 inputs"),
        (set_to(E, "families", 0, "degrees", value=[10**9]), "degrees from 1 to 200"),
        (set_to(E, "families", 0, "harmonics", value=10**9), "family: matrix"),
        (drop(E, "families", 0, "matrix", 0, 0), "rows of one length"),
        (set_to(E, "families", 0, "half_range_rad", value=0.0), "half_range"),
        (set_to(E, "families", 0, "periodic", value=1), "periodic"),
        (drop("domain", "lower_rad", 0), "domain"),
        (set_to("domain", "lower_rad", 0, value=9.0), "below its upper"),
        (lambda d: d["inputs"].append("q6_deg"), "factors"),
        (set_to("inputs", value=[]), "factors|shape"),
        (lambda d: (d["inputs"].clear(), d["couplings"].clear()), "inputs|reshape|periodic"),
        (set_to("inputs", 0, value="q3real_deg"), "each one once"),
        (drop("couplings", 0, "factors", 0), "factors"),
        (set_to("couplings", 1, "lower_rad", value=9.0), "couplings"),
        (set_to("load_direction", value=[0.0, 1.0]), "load_direction"),
        (set_to("load_direction", value=[0.0, 1.0, 1.0]), "load_direction"),
        (set_to("errors", "rms_relative", value=-0.1), "error figures"),
        (set_to("errors", "rms_relative", value="0.1"), "errors.rms_relative"),
        (set_to("errors", "more", value=0.1), "errors.more"),
        (set_to("error_bars", "quantile", value=-1.0), "error bars"),
        (lambda d: [r.append(1.0) for r in d["error_bars"]["scale"]["coefficients"]], "error bars"),
        (drop("error_bars", "leverage", "families", 0), r"\(t, 1\)|inputs"),
        (set_to("parameters", "misfit", value=-1.0), "uncertainty of parameters"),
        (set_to("parameters", "undetermined", value=[]), "uncertainty of parameters"),
        (set_to("parameters", "open_share", value=None), "uncertainty of parameters"),
        (set_to("target", value="factored"), "factor"),
        (set_to("target", value="log-compliance"), "target"),
        (set_to("factor", value={"group": [-1], "weights": []}), "factor"),
        (drop("kinematics", "T_pre", 0, 0, 0), "shape|inhomogeneous|kinematics"),
        (drop("kinematics", "T_pre", 0), "kinematics"),
        (drop("kinematics", "joint_names", 0), "kinematics"),
        (set_to("periodic", value=[True]), "periodic"),
        (set_to("extra", value=1), "extra"),
        (drop("notes"), "notes"),
    ],
)
def test_files_that_do_not_fit_are_refused_by_name(tmp_path, good, change, words):
    path = edited(tmp_path, good["plain"], change)
    info = refuses("F005 F006 F007 F011", words, load_surrogate, path)
    assert str(path) in str(info)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (set_to("factor", "group", 0, value=7), "groups"),
        (set_to("factor", "group", 0, value=10**30), "beyond 64 bits"),
        (set_to("factor", "group", value=[]), "groups"),
        (drop("factor", "group", 0), "numbers a pose"),
        (drop("factor", "weights", 0), "groups"),
        (drop("factor", "weights", 0, "families", 0), r"\(t, 2\)|inputs"),
        (set_to("factor", value=None), "factor"),
        (set_to("target", value="direct"), "factor"),
    ],
)
def test_factors_that_do_not_fit_are_refused(tmp_path, good, change, words):
    refuses("F005 F007 F011", words, load_surrogate, edited(tmp_path, good["factored"], change))


def test_a_number_too_large_for_a_float_is_refused(tmp_path, good):
    path = edited(tmp_path, good["plain"], set_to(E, "coefficients", 0, value=[12345.0]))
    path.write_text(path.read_text(encoding="utf-8").replace("12345.0", "1e999"), encoding="utf-8")
    refuses("F005", r"1e999 is beyond the largest number", load_surrogate, path)


def test_all_faults_are_reported_at_once(tmp_path, good):
    def two(data):
        data["robot"] = 3
        data.pop("notes")

    refuses("F011", r"(?s)2 problem.*robot.*notes", load_surrogate, edited(tmp_path, good["plain"], two))


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_truncated_file_is_refused(tmp_path, good, share):
    path = tmp_path / "s.json"
    path.write_text(good["factored"][: int(share * len(good["factored"]))], encoding="utf-8")
    refuses("F005", r"not valid JSON.*fit the surrogate again", load_surrogate, path)


@pytest.mark.parametrize("text", ["", "{", "[1]", "7", "[" * 100_000, "\x00", "null", '"text"'])
def test_not_a_surrogate_file(tmp_path, text):
    path = tmp_path / "s.json"
    path.write_text(text, encoding="utf-8")
    refuses("F005 F007", "surrogate file", load_surrogate, path)
    path.write_bytes(b"\xff\xfe\x00")
    refuses("F004", "surrogate file", load_surrogate, path)
    refuses("F001", "cannot be read", load_surrogate, tmp_path / "missing.json")
