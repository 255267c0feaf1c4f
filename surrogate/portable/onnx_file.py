"""A surrogate as an ONNX model in double precision, for every program that has an ONNX runtime."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robots.arrays import Array
from robots.files.written import write_whole
from robots.lazily import optional
from surrogate.expansion import TURN, Expansion, Family
from surrogate.portable.content import SCHEMA, Portable, Status, content_hash
from surrogate.portable.words import identifier, provenance, with_unit

if TYPE_CHECKING:
    from onnx import ModelProto

# Known to onnxruntime from 1.13 on; newer numbers add nothing that is needed here.
OPSET, IR_VERSION = 17, 8
INPUT, STATUS = "q_rad", "status"
_LARGEST = float(np.finfo(np.float64).max)


def onnx_model(portable: Portable) -> ModelProto:
    """Build the model: ``q_rad`` (n, k) double -> the quantity (n, m) or (n, 6, 6) double, and ``status`` (n,) int64.

    The quantity's name carries its unit, as in ``compliance_m_per_N``. Where ``status`` is not 0
    (:class:`~surrogate.portable.content.Status`) it is NaN. What it is about stands in the metadata.

    Raises
    ------
    InputError
        The package onnx is missing.
    """
    onnx = optional("onnx", "ONNX files", "onnx")
    graph = _Graph(onnx)
    p = portable
    y = _link(graph, p)
    name = with_unit(p.quantity, p.unit)
    if name in (INPUT, STATUS):
        name = f"{name}_value"
    status = _status(graph, p, y)
    graph.node("Identity", status, name=STATUS)
    good = graph.node("Unsqueeze", graph.node("Equal", status, np.int64(0)), np.arange(1, len(p.shape) + 1))
    graph.node("Where", good, y, np.float64(np.nan), name=name)
    kinds, info = onnx.TensorProto, onnx.helper.make_tensor_value_info
    made = onnx.helper.make_graph(
        graph.nodes,
        identifier(p.name),
        [info(INPUT, kinds.DOUBLE, ["n", p.expansion.n_inputs])],
        [info(name, kinds.DOUBLE, ["n", *p.shape]), info(STATUS, kinds.INT64, ["n"])],
        graph.constants,
    )
    opset = onnx.helper.make_opsetid("", OPSET)
    model: ModelProto = onnx.helper.make_model(
        made,
        opset_imports=[opset],
        ir_version=IR_VERSION,
        producer_name="stiffarm",
        doc_string="\n".join(provenance(p)),
    )
    onnx.helper.set_model_props(model, metadata(p))
    onnx.checker.check_model(model, full_check=True)
    return model


def write_onnx(portable: Portable, path: str | Path) -> None:
    """Write `onnx_model`, whole or not at all; a file that is there is replaced.

    Raises
    ------
    InputError
        The package onnx is missing.
    """
    data = onnx_model(portable).SerializeToString(deterministic=True)
    write_whole(Path(path), data)


def metadata(portable: Portable) -> dict[str, str]:
    """What the model's properties say; lists and mappings as JSON, infinite bounds as null."""
    p = portable
    c = p.couplings
    coupled = [
        {"name": n, "factors": row.tolist(), "lower_rad": _bound(low), "upper_rad": _bound(high)}
        for n, row, low, high in zip(c.names, c.matrix, c.lower, c.upper, strict=True)
    ]
    return {
        "schema": SCHEMA,
        "name": p.name,
        "robot": p.robot,
        "model_hash": p.model_hash,
        "quantity": p.quantity,
        "unit": p.unit,
        "link": p.link,
        "inputs": json.dumps(list(p.inputs)),
        "domain_rad": json.dumps({"lower": p.lower.tolist(), "upper": p.upper.tolist()}),
        "couplings": json.dumps(coupled),
        "fixed_deg": json.dumps(dict(p.fixed_deg)),
        "held_out_errors": json.dumps(dict(p.errors)),
        "notes": json.dumps(list(p.notes)),
        "status": json.dumps({str(int(s)): s.name for s in Status}),
        "sha256": content_hash(p),
    }


class _Graph:
    """Nodes and constants, named as they come."""

    def __init__(self, onnx: Any) -> None:
        self._onnx = onnx
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def node(self, operator: str, *inputs: str | np.ndarray | np.generic, name: str = "", **attributes: object) -> str:
        """Add a node; arrays among its inputs become constants. Gives the name of its output."""
        names = [i if isinstance(i, str) else self._constant(np.asarray(i)) for i in inputs]
        name = name or f"{operator.lower()}_{len(self.nodes)}"
        self.nodes.append(self._onnx.helper.make_node(operator, names, [name], **attributes))
        return name

    def _constant(self, values: np.ndarray) -> str:
        name = f"constant_{len(self.constants)}"
        self.constants.append(self._onnx.numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    def all_between(self, values: str, lower: Array, upper: Array) -> str:
        """Which rows (n,) of values (n, c) lie in the bounds (c,) altogether; NaN never does."""
        inside = self.node("And", self.node("GreaterOrEqual", values, lower), self.node("LessOrEqual", values, upper))
        # No runtime takes minima of truth values.
        least = self.node("ReduceMin", self._as_double(inside), axes=[1], keepdims=0)
        return self.node("Greater", least, np.float64(0.5))

    def _as_double(self, values: str) -> str:
        return self.node("Cast", values, to=self._onnx.TensorProto.DOUBLE)


def _expansion(graph: _Graph, e: Expansion) -> str:
    terms = ""
    for i, (family, column) in enumerate(zip(e.families, e.terms.T, strict=True)):
        functions = _family(graph, family, graph.node("Gather", INPUT, np.array([i]), axis=1))
        factor = graph.node("Gather", functions, column, axis=1)
        terms = graph.node("Mul", terms, factor) if terms else factor
    return graph.node("MatMul", terms, e.coefficients)


def _family(graph: _Graph, family: Family, q: str) -> str:
    """Functions (n, f) of an angle (n, 1)."""
    x = graph.node("Sub", q, np.float64(family.centre))
    if family.periodic:
        turns = graph.node("Round", graph.node("Div", x, np.float64(TURN)))
        x = graph.node("Sub", x, graph.node("Mul", turns, np.float64(TURN)))
    one = graph.node("Add", graph.node("Mul", x, np.float64(0.0)), np.float64(1.0))
    parts, m = [one], family.harmonics
    if m:
        multiples = graph.node("Mul", x, np.arange(1.0, m + 1.0)[None])
        parts += [graph.node("Cos", multiples), graph.node("Sin", multiples)]
    if family.degrees:
        u = graph.node("Div", x, np.float64(family.half_range))
        legendre = _legendre(graph, one, u, family.degrees[-1])
        parts += [legendre[d] for d in family.degrees]
    # All cosines stand before all sines here.
    order = [0, *range(1, 2 * m, 2), *range(2, 2 * m + 1, 2), *range(2 * m + 1, family.matrix.shape[1])]
    return graph.node("MatMul", graph.node("Concat", *parts, axis=1), family.matrix[:, order].T)


def _legendre(graph: _Graph, one: str, u: str, highest: int) -> list[str]:
    p = [one, u]
    for d in range(2, highest + 1):
        rising = graph.node("Mul", graph.node("Mul", u, np.float64(2 * d - 1)), p[-1])
        older = graph.node("Mul", p[-2], np.float64(d - 1))
        p.append(graph.node("Div", graph.node("Sub", rising, older), np.float64(d)))
    return p


def _link(graph: _Graph, p: Portable) -> str:
    s = _expansion(graph, p.expansion)
    if p.link == "exp":
        return graph.node("Exp", s)
    if p.factor is None:
        return s
    # 0 keeps the number of poses.
    rows = graph.node("Reshape", s, np.array([0, len(p.row_weights), p.expansion.n_outputs // len(p.row_weights)]))
    weighted = rows
    if len(p.sums) > 1:
        one = graph.node("Exp", graph.node("Mul", graph.node("Gather", s, np.array([0]), axis=1), np.float64(0.0)))
        weights = [graph.node("Exp", _expansion(graph, w)) for w in p.sums[1:]]
        each = graph.node("Gather", graph.node("Concat", one, *weights, axis=1), p.row_weights, axis=1)
        weighted = graph.node("Mul", rows, graph.node("Unsqueeze", each, np.array([2])))
    y = graph.node("MatMul", graph.node("Transpose", rows, perm=[0, 2, 1]), weighted)
    if p.link == "squares":
        return graph.node("Reshape", y, np.array([0, 1]))
    # Symmetric to the last digit.
    return graph.node("Mul", graph.node("Add", y, graph.node("Transpose", y, perm=[0, 2, 1])), np.float64(0.5))


def _status(graph: _Graph, p: Portable, y: str) -> str:
    flat = y if len(p.shape) == 1 else graph.node("Reshape", y, np.array([0, p.n_values]))
    codes = {s: np.int64(s) for s in Status}
    limits = np.full(1, -_LARGEST), np.full(1, _LARGEST)
    status = graph.node("Where", graph.all_between(flat, *limits), codes[Status.OK], codes[Status.NOT_FINITE])
    if p.couplings.names:
        sums = graph.node("MatMul", INPUT, p.couplings.matrix.T)
        kept = graph.all_between(sums, *p.coupled_bounds)
        status = graph.node("Where", kept, status, codes[Status.COUPLINGS_BROKEN])
    status = graph.node("Where", graph.all_between(INPUT, *p.bounds), status, codes[Status.OUTSIDE_DOMAIN])
    return graph.node("Where", graph.all_between(INPUT, *limits), status, codes[Status.NOT_FINITE])


def _bound(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
