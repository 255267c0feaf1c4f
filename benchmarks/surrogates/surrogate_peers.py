"""Our surrogates against ready-made regressors, in one run: error, time to fit, time to query, size, error bars.

    python benchmarks/surrogates/surrogate_peers.py [--quick] [--robot NAME ...] [--write] [--json]

``--write`` writes docs/validation/surrogate_peers.md. One thread is fair to all: set OMP_NUM_THREADS=1 and
NUMBA_NUM_THREADS=1.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from peer_comparison import Errors, PeerResult, compare_with_peers
from peers import OwnCandidate

import fem
from benchmarks.asked import asked
from fem.springs import FourierBasis
from robots import content_hash, load_description
from robots.arrays import Array
from surrogate.arm_scope import reduced_box, scope_of, with_whole_turns
from surrogate.asking import full_poses
from surrogate.designs import space_filling_design
from surrogate.error_bars import learn_bars
from surrogate.expansion import Expansion
from surrogate.factored import fit_factored
from surrogate.fast import evaluate
from surrogate.fit import fit
from surrogate.scope import Scope

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "validation" / "surrogate_peers.md"
TEXT = HERE / "surrogate_peers_page.md"
BOUNDARY = 1000
# ln k = ln k0 + a cos q + b sin q + c cos 2q of each spring: made up, stiffness within a factor of 0.7 to 1.4.
LAW_SHARES = (0.20, 0.10, 0.05)


@dataclass(frozen=True, eq=False)
class Case:
    """An arm, and what of it is to be learned."""

    name: str
    says: str
    model: fem.ArmModel
    scope: Scope
    n_train: int
    n_test: int

    def run(self, Q: Array) -> Array:
        """Compliance along the load (n,) m/N."""
        return np.asarray(1.0 / fem.directional_stiffness(self.model, self.full(Q), self.along))

    def full(self, Q: Array) -> Array:
        """Poses of all joints (n, dof) rad."""
        return full_poses(self.model.robot, self.scope, Q)

    @property
    def along(self) -> Array:
        """Direction of the load (3,)."""
        return np.array(self.scope.load_direction)

    def design(self, n: int, density: Any, seed: int) -> Array:
        """Poses over one turn at most of each input."""
        rng = np.random.default_rng(seed)
        return space_filling_design(
            *reduced_box(self.scope), n, rng, density=density, couplings=self.scope.couplings, names=self.scope.inputs
        )


def case_of(name: str, quick: bool) -> Case:
    description = load_description(name)
    model = fem.build_model(description)
    if name == "xr701":
        inputs = ("q2_deg", "q3real_deg", "q4_deg", "q5_deg")
        springs = {"j2": 1.45e6, "j3": 0.80e6, "j4": 0.84e6, "j5": 1.0e6}
        says, n_train = "beam links, parallelogram", 4096
    else:
        inputs = ("q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg")
        springs = {"j2": 0.8994e6, "j3": 1.1118e6, "j4": 6.44e4, "j5": 2.54e4}
        tool = np.eye(4)
        tool[:3, 3] = (0.10, 0.0, 0.25)
        model = replace(model, robot=replace(model.robot, T_flange_tool=tool))
        says, n_train = "beam links, tool point 100 mm beside and 250 mm before the flange", 8192
    columns = {joint: model.robot.joint_names.index(joint) for joint in springs}
    model = model.with_springs(
        {
            joint: fem.LawSpring(FourierBasis(columns[joint], 2), np.array([np.log(k), *LAW_SHARES, 0.0]))
            for joint, k in springs.items()
        }
    )
    scope = scope_of(model.robot, content_hash(description), inputs)
    if quick:
        # Enough for the trigonometric basis: 625 and 3125 terms.
        n_train = 2048 if name == "xr701" else 4096
    case = Case(name, says, model, scope, n_train, 1000 if quick else 10_000)
    return replace(case, scope=with_whole_turns(scope, case.run, np.random.default_rng(9)))


def expansion_bytes(expansion: Expansion, index_bytes: int = 1) -> int:
    """Coefficients, which functions make up each term, and the functions' own numbers."""
    families = sum(8 * (f.matrix.size + 2) for f in expansion.families)
    return 8 * expansion.coefficients.size + index_bytes * expansion.terms.size + families


def scalar_candidate(case: Case, title: str, basis: Any, degree: int, target: Any) -> OwnCandidate:
    """A named basis fitted to the very runs the peers get; its bars learn from as many uniform runs more."""
    extra = case.design(4096, "uniform", 7)
    y_extra = case.run(extra)

    def value(expansion: Expansion, Q: Array) -> Array:
        y = evaluate(expansion, Q)[:, 0]
        return np.asarray(np.exp(y) if target == "logarithm" else y)

    def learn(Q: Array, y: Array) -> Any:
        found = fit(Q, y, case.scope, basis=basis, degree=degree, target=target)
        expansion = found.basis.expansion(found.coefficients)
        error = value(expansion, extra) / y_extra - 1.0
        return expansion, learn_bars(found.basis, case.scope, Q, extra, error)

    def interval(fitted: Any, Q: Array) -> tuple[Array, Array]:
        c, half = value(fitted[0], Q), fitted[1].half_width(Q)
        return c * (1.0 - half), c * (1.0 + half)

    return OwnCandidate(
        title,
        learn,
        lambda fitted, Q: value(fitted[0], Q),
        lambda fitted: expansion_bytes(fitted[0]),
        interval,
        lambda fitted: expansion_bytes(fitted[1].leverage) + expansion_bytes(fitted[1].scale) + 16,
    )


def factored_candidate(case: Case) -> OwnCandidate:
    """Rows of the 6 x 6 compliance: it runs the model at poses of its own and asks it for more than one number."""

    def learn(Q: Array, y: Array) -> Any:
        found = fit_factored(
            lambda poses: fem.compliance_factor(case.model, case.full(poses)),
            lambda n: case.design(n, "arcsine", 8),
            case.scope,
        )
        whole = found.basis.expansion(found.coefficients)
        rows = found.coefficients.reshape(whole.n_terms, -1, 6) @ np.concatenate([case.along, np.zeros(3)])
        return whole, Expansion(whole.families, whole.terms, rows), found.factor, found.runs

    def value(fitted: Any, Q: Array) -> Array:
        _, rows, factor, _ = fitted
        return np.asarray(np.sum(factor.weight(Q) * evaluate(rows, Q) ** 2, axis=1))

    def size(fitted: Any) -> int:
        whole, _, factor, _ = fitted
        laws = sum(expansion_bytes(law) for law in factor.weights)
        return expansion_bytes(whole) + laws + factor.group.size

    title = "stiffarm: factored, rows of the 6 x 6 compliance (not the same runs)"
    return OwnCandidate(title, learn, value, size, n_train=lambda fitted: int(fitted[3]))


def own_of(case: Case) -> dict[str, OwnCandidate]:
    return {
        "ours, polynomial": scalar_candidate(case, "stiffarm: polynomial of degree 6", "polynomial", 6, "logarithm"),
        "ours, trigonometric": scalar_candidate(
            case, "stiffarm: trigonometric of order 2", "trigonometric", 2, "direct"
        ),
        "ours, adaptive": scalar_candidate(case, "stiffarm: terms chosen one by one", "adaptive", 2, "direct"),
        "ours, factored": factored_candidate(case),
    }


def compared(case: Case, say: Callable[[str], None]) -> list[PeerResult]:
    Q = case.design(case.n_train, "arcsine", 0)
    uniform = case.design(case.n_test, "uniform", 1)
    # Boundary poses fall on the same corners again and again; each counts once.
    edge = np.unique(case.design(BOUNDARY, "boundary", 2), axis=0)
    Q_test = np.vstack([uniform, edge])
    return compare_with_peers(
        Q,
        case.run(Q),
        Q_test,
        case.run(Q_test),
        boundary=np.arange(len(Q_test)) >= len(uniform),
        own=own_of(case),
        progress=lambda done, total, name: say(f"{case.name}: {done} of {total} {name}"),
        # Processor time: other work on the machine does not count. It needs one thread.
        clock=time.process_time,
    )


def per_cent(value: float) -> str:
    return f"{100.0 * value:.2g}" if abs(value) < 1.0 else f"{100.0 * value:.0f}"


def errors_cell(errors: Errors | None) -> str:
    return "-" if errors is None else f"{per_cent(errors.rms)} / {per_cent(errors.worst)}"


def size_cell(row: PeerResult) -> str:
    assert row.size is not None
    bars = "" if row.size.bars is None else f" + {row.size.bars / 1000:.3g}"
    return f"{row.size.values / 1000:.3g}{bars}"


def table(rows: Sequence[PeerResult]) -> str:
    head = (
        "| surrogate | runs | uniform, % | boundary, % | fit (choice), s | 1e5 queries, s | with bars, s "
        "| size, kB | in the 95 % bar |\n|---|---|---|---|---|---|---|---|---|"
    )
    lines = [head]
    for r in rows:
        if r.refused is not None:
            lines.append(f"| {r.name} | | refused: {r.refused} | | | | | | |")
            continue
        choice = f" ({r.choose_s:.2g})" if r.choose_s else ""
        bars = "-" if r.bar_query_s is None else f"{r.bar_query_s:.2g}"
        inside = "-" if r.uniform is None or r.uniform.coverage is None else f"{100 * r.uniform.coverage:.1f} %"
        name = f"**{r.name}**" if r.own else r.name
        lines.append(
            f"| {name} | {r.n_train} | {errors_cell(r.uniform)} | {errors_cell(r.boundary)} | {r.fit_s:.2g}{choice} "
            f"| {r.query_s:.2g} | {bars} | {size_cell(r)} | {inside} |"
        )
    return "\n".join(lines)


def notes(rows: Sequence[PeerResult]) -> str:
    out = []
    for r in rows:
        said = [*([f"chosen: {r.chosen}"] if r.chosen else []), *r.messages]
        if said:
            out.append(f"- {r.name}: {'; '.join(said)}")
    return "\n".join(out)


def page(results: dict[str, tuple[Case, list[PeerResult]]]) -> str:
    parts = []
    for name, (case, rows) in results.items():
        n_test = [e.n for e in (rows[0].uniform, rows[0].boundary) if e is not None]
        parts.append(
            f"## {name}: {case.says}\n\n{len(case.scope.inputs)} inputs ({', '.join(case.scope.inputs)}), "
            f"{case.n_train} runs, {' + '.join(map(str, n_test))} held-out poses (uniform + boundary).\n\n"
            f"{table(rows)}\n\n{notes(rows)}"
        )
    return TEXT.read_text(encoding="utf-8").replace("{tables}", "\n\n".join(parts))


def main() -> None:
    options = asked(__doc__, quick=False, robot=[*("xr701", "kr60-3")], write=False, json=False)
    robots = options.robot or ["xr701", "kr60-3"]
    results = {}
    for name in robots:
        case = case_of(name, options.quick)
        results[name] = (case, compared(case, lambda text: print(text, file=sys.stderr, flush=True)))
    if options.json:
        print(json.dumps({name: [asdict(r) for r in rows] for name, (_, rows) in results.items()}, indent=2))
    elif options.write:
        PAGE.write_text(page(results), encoding="utf-8")
    else:
        print(page(results))


if __name__ == "__main__":
    main()
