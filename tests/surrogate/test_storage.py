import json
from dataclasses import fields

import numpy as np
import pytest

from robots.errors import InputError
from surrogate.fit import fit, space_filling_design
from surrogate.model import SCHEMA, Couplings, Scope, Surrogate, predict_compliance, query
from surrogate.storage import _checksum, load_surrogate, save_surrogate

LOWER, UPPER = np.array([-0.6, 0.7]), np.array([0.8, 2.0])


def make(basis="polynomial", target="log-compliance"):
    def compliance(Q):
        return 1e-6 * (1.3 + np.cos(Q[:, 0]) * np.sin(Q[:, 1]))

    couplings = Couplings(("sum", "forearm"), np.array([[1.0, 1.0], [1.0, -1.0]]),
                          np.array([-np.inf, -2.2]), np.array([2.7, 0.05]))  # fmt: skip
    scope = Scope(
        robot="xr701",
        model_hash="0f" * 32,
        load_direction=(0.6, 0.0, -0.8),
        inputs=("q2_deg", "q3real_deg"),
        fixed_deg={"q1_deg": 0.1, "q4_deg": -12.3},
        lower=LOWER,
        upper=UPPER,
        couplings=couplings,
    )
    Q = space_filling_design(LOWER, UPPER, 60, np.random.default_rng(0), couplings=couplings)
    Q_test = space_filling_design(LOWER, UPPER, 30, np.random.default_rng(1), couplings=couplings)
    return fit(
        Q, compliance(Q), scope=scope, Q_test=Q_test, y_test=compliance(Q_test), basis=basis, target=target,
        notes=("simulated", "größer als µ"),
    )  # fmt: skip


def bits(value):
    return value.tobytes() if isinstance(value, np.ndarray) else value


@pytest.mark.parametrize("basis", ["polynomial", "trigonometric"])
@pytest.mark.parametrize("target", ["compliance", "log-compliance"])
def test_a_surrogate_comes_back_bit_for_bit(tmp_path, basis, target):
    s = make(basis, target)
    save_surrogate(s, tmp_path / "s.json")
    back = load_surrogate(tmp_path / "s.json")
    for f in fields(Surrogate):
        own, other = getattr(s, f.name), getattr(back, f.name)
        if isinstance(own, Couplings):
            for part in fields(Couplings):
                assert bits(getattr(own, part.name)) == bits(getattr(other, part.name)), part.name
        else:
            assert bits(own) == bits(other), f.name
    Q = np.random.default_rng(2).uniform(LOWER, UPPER, (500, 2))
    assert predict_compliance(back, Q).tobytes() == predict_compliance(s, Q).tobytes()
    assert query(back, Q, extrapolate=True).reachable.tolist() == s.couplings.kept(Q).all(axis=1).tolist()


def test_saving_leaves_one_strict_json_file_and_replaces_the_old_one(tmp_path):
    path = tmp_path / "s.json"
    path.write_text("old", encoding="utf-8")
    save_surrogate(make(), path)
    assert [p.name for p in tmp_path.iterdir()] == ["s.json"]
    data = json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert data["schema"] == SCHEMA
    assert data["couplings"][0]["lower_rad"] is None


def test_a_failed_save_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "s.json"
    save_surrogate(make(), path)
    before = path.read_bytes()

    def fail(self, target):
        raise OSError("disk full")

    monkeypatch.setattr("pathlib.Path.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        save_surrogate(make("trigonometric"), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["s.json"]


def edited(tmp_path, change, seal=True):
    """Write a surrogate file with a change, its checksum made to fit if ``seal``."""
    path = tmp_path / "s.json"
    save_surrogate(make("trigonometric"), path)
    data = json.loads(path.read_text(encoding="utf-8"))
    change(data)
    if seal:
        data["content_sha256"] = _checksum(data)
    path.write_text(json.dumps(data), encoding="utf-8")
    return path


def test_layout_may_change_but_content_may_not(tmp_path):
    load_surrogate(edited(tmp_path, lambda data: None, seal=False))

    def nudge(data):
        data["coefficients"][3] = float(np.nextafter(data["coefficients"][3], 1.0))

    with pytest.raises(InputError, match="checksum"):
        load_surrogate(edited(tmp_path, nudge, seal=False))
    # The same edit with a fitting checksum loads: it was the checksum that noticed it.
    load_surrogate(edited(tmp_path, nudge))


def set_to(*keys, value):
    def change(data):
        for key in keys[:-1]:
            data = data[key]
        data[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (set_to("schema", value="stiffarm-surrogate/7"), f"newer.*surrogate/7.*allowed: {SCHEMA}.*update"),
        (set_to("schema", value="something-else/1"), f"something-else/1.*allowed: {SCHEMA}"),
        (lambda data: data.pop("schema"), f"schema.*allowed: {SCHEMA}"),
        (set_to("coefficients", 0, value=float("nan")), "not valid JSON.*NaN"),
        (set_to("coefficients", 0, value=float("-inf")), "not valid JSON.*Infinity"),
        (lambda data: data["coefficients"].pop(), "24 coefficients"),
        (lambda data: data["basis"]["terms"].pop(), "number of terms"),
        (set_to("basis", "terms", 0, value=[0, 9]), "terms are not those"),
        (set_to("basis", "degree", value=10**9), "degree or order"),
        (lambda data: data["basis"]["recombination"][0].pop(), "recombination"),
        (lambda data: data["scaling"]["centre_rad"].pop(), "basis"),
        (set_to("scaling", "half_range_rad", 0, value=0.0), "half_range"),
        (lambda data: data["domain"]["lower_rad"].pop(), "domain"),
        (lambda data: data["inputs"].append("q6_deg"), "factors"),
        (lambda data: data["couplings"][0]["factors"].pop(), "factors"),
        (set_to("load_direction", value=[0.0, 1.0]), "load_direction"),
        (set_to("errors", "rms_relative", value=-0.1), "error figures"),
        (set_to("errors", "rms_relative", value="0.1"), "errors.rms_relative"),
        (set_to("extra", value=1), "extra"),
        (lambda data: data.pop("notes"), "notes"),
    ],
)
def test_files_that_do_not_fit_are_refused_by_name(tmp_path, change, words):
    path = edited(tmp_path, change)
    with pytest.raises(InputError, match=words) as info:
        load_surrogate(path)
    assert str(path) in str(info.value)


def test_a_number_too_large_for_a_float_is_refused(tmp_path):
    path = edited(tmp_path, set_to("coefficients", 0, value=12345.0))
    path.write_text(path.read_text(encoding="utf-8").replace("12345.0", "1e999"), encoding="utf-8")
    with pytest.raises(InputError, match=r"coefficients.0"):
        load_surrogate(path)


def test_all_faults_are_reported_at_once(tmp_path):
    def two(data):
        data["robot"] = 3
        data.pop("notes")

    with pytest.raises(InputError, match=r"(?s)2 problem.*robot.*notes"):
        load_surrogate(edited(tmp_path, two))


@pytest.mark.parametrize("text", ["", "{", "[1]", "7", "[" * 100_000, "\x00"])
def test_not_a_surrogate_file(tmp_path, text):
    path = tmp_path / "s.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="surrogate file"):
        load_surrogate(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="surrogate file"):
        load_surrogate(path)
    with pytest.raises(InputError, match="cannot be read"):
        load_surrogate(tmp_path / "missing.json")
