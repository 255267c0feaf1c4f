"""The ONNX file, run by onnxruntime, against what every portable form must answer."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import oracles
import pytest
from portable_cases import CASES, HOSTILE, check, portable, poses, reference
from refusals import refuses

from surrogate.portable import Link, Portable, onnx_model, write_onnx
from surrogate.portable.content import content_hash
from surrogate.scope import Couplings

onnx = oracles.load("onnx")
onnxruntime = oracles.load("onnxruntime")


def session(data: bytes | str) -> Any:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])


def answers(p: Portable, Q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    values, status = session(onnx_model(p).SerializeToString()).run(None, {"q_rad": Q})
    return values, status


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c[0]}-{len(c[1])}-{c[2]}")
def test_runtime_answers_as_the_surrogate(case: tuple[Link, tuple[str, ...], int], rng: np.random.Generator) -> None:
    p = portable(*case, rng)
    Q = poses(p, 1000, rng)
    expected = reference(p, Q)
    assert {0, 1, 3} <= set(expected[1].tolist())
    values, status = answers(p, Q)
    assert values.dtype == np.float64
    assert values.shape == (1000, *p.shape)
    # 1e-12: a thousand times less than asked for; single precision anywhere would leave 1e-7.
    check(p, expected, values, status, rtol=1e-12)


@pytest.mark.parametrize("link", ["identity", "factor"])
def test_no_pose_and_one_pose(link: Link, rng: np.random.Generator) -> None:
    p = portable(link, ("mixed", "periodic"), 6, rng)
    model = session(onnx_model(p).SerializeToString())
    values, status = model.run(None, {"q_rad": np.empty((0, 2))})
    assert values.shape == (0, *p.shape)
    assert status.shape == (0,)
    Q = np.array([[f.centre for f in p.expansion.families]])
    check(p, reference(p, Q), *model.run(None, {"q_rad": Q}), rtol=1e-12)


def test_overflow_is_told(rng: np.random.Generator) -> None:
    p = portable("exp", ("polynomial",) * 2, 1, rng)
    e = p.expansion
    steep = type(e)(e.families, e.terms, 1e6 * e.coefficients)
    p = portable("exp", ("polynomial",) * 2, 1, rng, couplings=Couplings.none(2), expansion=steep)
    Q = np.random.default_rng(1).uniform(p.lower, p.upper, (50, 2))
    expected = reference(p, Q)
    assert 3 in expected[1]
    values, status = answers(p, Q)
    np.testing.assert_array_equal(status, expected[1])
    assert np.isnan(values[status != 0]).all()


def test_names_and_metadata(rng: np.random.Generator, tmp_path: Path) -> None:
    p = portable("identity", ("mixed", "periodic"), 1, rng)
    path = tmp_path / "surrogate.onnx"
    write_onnx(p, path)
    assert [f.name for f in tmp_path.iterdir()] == ["surrogate.onnx"]
    model = session(str(path))
    assert [(i.name, i.shape, i.type) for i in model.get_inputs()] == [("q_rad", ["n", 2], "tensor(double)")]
    assert [(o.name, o.shape) for o in model.get_outputs()] == [("compliance_m_per_N", ["n", 1]), ("status", ["n"])]
    about = model.get_modelmeta().custom_metadata_map
    assert (about["robot"], about["quantity"], about["unit"]) == ("xr701", "compliance", "m/N")
    assert (about["model_hash"], about["schema"], about["link"]) == ("ab12", "stiffarm-portable/1", "identity")
    assert json.loads(about["inputs"]) == ["q2_deg", "q3_deg"]
    domain = json.loads(about["domain_rad"])
    np.testing.assert_array_equal(domain["lower"], p.lower)
    np.testing.assert_array_equal(domain["upper"], p.upper)
    coupled = json.loads(about["couplings"])
    assert [c["factors"] for c in coupled] == p.couplings.matrix.tolist()
    assert (coupled[1]["lower_rad"], coupled[0]["upper_rad"]) == (None, p.couplings.upper[0])
    assert json.loads(about["held_out_errors"]) == {"rms_relative": 0.00125}
    assert json.loads(about["fixed_deg"]) == {"q1_deg": 12.5}
    assert len(about["sha256"]) == 64
    assert "Status 2:" in onnx.load(path).doc_string


def test_same_bytes_for_the_same_surrogate(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_onnx(portable("exp", ("mixed", "gaps"), 2, np.random.default_rng(3)), tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_hash_tells_numbers_apart(rng: np.random.Generator) -> None:
    def sha(**changes: object) -> str:
        p = portable("identity", ("mixed", "gaps"), 1, np.random.default_rng(5), **changes)
        return str({m.key: m.value for m in onnx_model(p).metadata_props}["sha256"])

    assert sha() == sha(notes=("other words",))
    p = portable("identity", ("mixed", "gaps"), 1, np.random.default_rng(5))
    e = p.expansion
    nudged = type(e)(e.families, e.terms, np.nextafter(e.coefficients, 9.0))
    assert len({sha(), sha(expansion=nudged), sha(lower=p.lower - 1e-6), sha(link="exp")}) == 4
    one = portable("squares", ("mixed",), 2, np.random.default_rng(5))
    assert one.factor is not None
    swapped = replace(one, factor=replace(one.factor, group=one.factor.group[::-1]))
    assert content_hash(one) != content_hash(swapped)


@pytest.mark.parametrize("text", HOSTILE)
def test_any_texts(text: str, rng: np.random.Generator) -> None:
    changes = {"name": text, "quantity": text, "unit": text, "robot": text, "model_hash": text, "notes": (text,)}
    p = portable("identity", ("mixed", "constant"), 1, rng, **changes)
    model = session(onnx_model(p).SerializeToString())
    assert model.get_modelmeta().custom_metadata_map["robot"] == text
    names = [o.name for o in model.get_outputs()]
    assert all(name.isidentifier() for name in names)


def test_a_quantity_called_as_another_output(rng: np.random.Generator) -> None:
    p = portable("identity", ("mixed",), 1, rng, quantity="status", unit="")
    assert [o.name for o in session(onnx_model(p).SerializeToString()).get_outputs()] == ["status_value", "status"]


def test_without_onnx(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "onnx", None)
    refuses(
        "F013",
        r"pip install 'stiffarm\[onnx\]'",
        write_onnx,
        portable("identity", ("mixed",), 1, rng),
        tmp_path / "surrogate.onnx",
    )
    assert not list(tmp_path.iterdir())
