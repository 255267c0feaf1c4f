"""report.html of a fit: the choice and its reason, the payload's numbers, bars that hold or do not, all escaped."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import HOSTILE_TITLE, run_here
from shortened import blank_pictures, few_runs

from fem import build_model
from fem.arm import Arm
from robots import load_description
from robots.quantities import known_to, ranged, relative
from stiffarm.commands.fit.figures.bars import (
    JudgedBars,
    chance,
    error_bars_figure,
    error_over_inputs_figure,
    gathered,
    parts,
)
from stiffarm.commands.fit.report import fitted, payload
from stiffarm.commands.fit.words import choice_words, doubts
from stiffarm.commands.query.command import inputs_table
from surrogate import Quantity, Trained, factored, query, scope_of, task_of, train, training

UNIFORM = 1500


@contextmanager
def fewer_runs() -> Iterator[None]:
    """As few as the rest of these tests, and few for the matrices and the factored basis too."""
    with few_runs(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "_MATRICES", 100)
        patch.setattr(factored, "_FEWEST_RUNS", 300)
        yield


def learned(**more: Any) -> Trained:
    """A KR 60 with rigid links, over two angles; the polynomial has more terms than there are runs."""
    model = build_model(load_description("kr60-3"), links="rigid")
    scope = scope_of(model.robot, "0" * 64, ("q2_deg", "q3_deg"))
    rng = np.random.default_rng(0)
    with fewer_runs():
        return train(task_of(model, scope, rng, **more), rng, degree=12, runs=80)


@pytest.fixture(scope="module")
def trained() -> Trained:
    """With a spring known to 10 % and one that the calibration left open."""

    def gradients(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.full((len(q), 1), 0.1), np.full((len(q), 1), 0.02)

    return learned(gradients=gradients, parameters=("j2.stiffness",), undetermined=("j5.stiffness",))


def written(result: Trained, folder: Path, title: str = "Arm") -> str:
    arm = Arm.of(load_description("kr60-3").model_copy(update={"title": title}), "rigid")
    with blank_pictures():
        fitted(arm, result).save(folder)
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(trained: Trained, tmp_path_factory: pytest.TempPathFactory) -> str:
    return written(trained, tmp_path_factory.mktemp("page") / "out", HOSTILE_TITLE)


def rows(page: str, caption: str) -> list[list[str]]:
    """Cells of the table with this caption (or summary)."""
    after = page[page.index(caption) :]
    body = re.search(r"<tbody>(.*?)</tbody>", after, re.DOTALL)
    assert body is not None
    lines = re.findall(r"<tr.*?</tr>", body.group(1), re.DOTALL)
    return [[text(c) for c in re.findall(r"<td[^>]*>(.*?)</td>", x)] for x in lines]


def text(page: str) -> str:
    return html.unescape(re.sub(r"<[^>]+>", "", page)).replace("\u00a0", " ")


def test_the_numbers_of_the_table_are_the_payloads(trained: Trained, page: str) -> None:
    content = payload(trained)
    table = list(zip(*rows(page, "Relative errors of the compliance on runs kept out"), strict=True))[1:]
    for row, s in zip(table, content["surrogates"], strict=True):
        names = ("rms", "p95", "interior_max", "max")
        shown = [relative(s[f"{n}_relative_error"]).replace("\u00a0", " ") for n in names]
        assert row[:6] == (f"{s['terms']:,}", f"{s['runs_fitted']:,}", *shown)
        assert row[7] == f"{100.0 * s['coverage_of_95_percent_bars']:.1f} %"
    six = content["surrogates"][0]["matrix_max_relative_error"]
    assert [r[6] for r in table] == [relative(six).replace("\u00a0", " "), "–"]
    assert f"are over {UNIFORM} uniform poses" in page


def test_the_basis_that_could_not_be_fitted_and_why(page: str) -> None:
    assert "polynomial was not fitted: fit: the basis has 91 terms, but there are 80 runs" in text(page)


def test_a_title_is_text_and_nothing_comes_from_elsewhere(page: str) -> None:
    assert HOSTILE_TITLE in text(page)
    for forbidden in ("<script", "http:", "https:", "<link", "<iframe", "url("):
        assert forbidden not in page
    sources = re.findall(r'src="([^"]{0,22})', page)
    # Neither basis errs by a millionth here, so no picture tells where.
    assert sources == ["data:image/png;base64,"] * 3
    assert "Nowhere. Errors of factored and trigonometric are below a millionth" in page


def test_why_in_one_sentence(trained: Trained) -> None:
    first, second = trained.surrogates

    def with_rms(a: float, b: float) -> Trained:
        pair = (replace(s, errors=replace(s.errors, rms_relative=r)) for s, r in ((first, a), (second, b)))
        return replace(trained, surrogates=tuple(pair))

    assert (
        "below a millionth count as equal, because no arm is known that well; among equals, it covers all load"
        in choice_words(with_rms(2e-9, 1e-9))
    )
    assert (
        "it has the smallest RMS error on runs kept out of the fit, 0.1\u00a0%, against 2\u00a0% (trigonometric)"
        in choice_words(with_rms(1e-3, 2e-2))
    )
    alone = replace(trained, surrogates=(first,))
    assert "no other basis could be fitted" in choice_words(alone)
    assert "it was asked for by name, and no other was tried" in choice_words(replace(alone, refused={}))


def test_doubts_are_said_aloud(trained: Trained) -> None:
    assert doubts(trained) == []
    poor = replace(trained.surrogates[1], errors=replace(trained.best.errors, max_relative=0.3, coverage95=0.9))
    largest, bars, direction = doubts(replace(trained, surrogates=(poor,)))
    assert "30\u00a0%" in largest
    assert "hold 90.0\u00a0%" in bars
    assert "one load direction only, 0, 0, -1" in direction


def test_shares_inside_by_width_of_the_bars(trained: Trained, page: str) -> None:
    best = trained.best
    Q, true = trained.held_out.Q[:UNIFORM], trained.held_out.value[:UNIFORM]
    error, half = np.abs(trained.predicted[best.basis][:UNIFORM] / true - 1.0), best.bars.half_width(Q)
    order = np.argsort(half, kind="stable").reshape(10, -1)
    shares = [f"{100.0 * np.mean(error[i] <= half[i]):.1f} %" for i in order]
    assert [r[4] for r in rows(page, "Error bars of the factored basis by their width")] == shares
    assert f"Of 1500 uniform runs {100.0 * best.errors.coverage95:.1f} % lie inside" in text(page)


def test_what_the_calibration_makes_of_it(page: str) -> None:
    # 1.96 times 10 %, as everywhere.
    assert "the compliance ± 20 % at the median pose and ± 20 % at the 95th percentile" in text(page)
    assert "j5.stiffness at 100 % of the poses. There the error bar is a lower bound" in text(page)


def test_where_it_holds_and_what_was_fixed(trained: Trained, page: str) -> None:
    best = trained.best
    inputs = inputs_table(best).frame()
    assert inputs["input"].tolist() == list(best.inputs)
    np.testing.assert_allclose(inputs[["from_deg", "to_deg"]], np.degrees([best.lower, best.upper]).T, rtol=1e-8)
    files = [r[0] for r in rows(page, "<caption>Files")]
    assert files == ["surrogate.json", *(f"surrogate_{b}.json" for b in ("factored", "trigonometric"))]
    fixed = {r[0]: r[2] for r in rows(page, "Fixed coordinates")}
    assert fixed["q1"] == "0 %"
    assert fixed["q5"] == relative(best.fixed_influence["q5_deg"]).replace("\u00a0", " ")
    # Joint 5 stands at 0: the axes of joints 4 and 6 are one line in all poses.
    assert "near a singularity: 100 % of the uniform poses" in text(page)


def test_the_example_can_be_asked(trained: Trained, page: str) -> None:
    commands = [r[1] for r in rows(page, "<caption>Commands")]
    assert "stiffarm map joints MODEL --surrogate surrogate.json --out map" in commands
    assert "stiffarm query surrogate.json poses.csv --matrix" in commands
    found = re.search(r"--pose q2_deg=(\S+),q3_deg=(\S+)$", commands[0])
    assert found is not None
    answer = query(trained.best, np.radians([[float(v) for v in found.groups()]]))
    value = float(answer.stiffness_N_per_mm[0])
    # 1.96 times 10 % of the compliance.
    ends = value / 1.196, value / (1.0 - 0.196)
    words = f"stiffness {known_to(value, *ends)} N/mm, 95 % interval {ranged(*ends)} N/mm"
    assert f"The answer to the first: {words}" in text(page)


def test_no_figure_that_nobody_can_act_on(trained: Trained, tmp_path: Path) -> None:
    """What the readings left open by far more than its own size has no number, and neither has round-off."""
    best, other = trained.surrogates
    assert best.parameters is not None
    wide = replace(best.parameters.gradients, coefficients=100.0 * best.parameters.gradients.coefficients)
    open_ones = replace(best, parameters=replace(best.parameters, gradients=wide))
    said = text(written(replace(trained, surrogates=(open_ones, other)), tmp_path / "out"))
    assert "do not rely on it" in said
    assert "More readings would narrow the intervals" in said
    assert not re.search(r"± \d{3,} %|\d·10⁻¹\d", said)


def test_what_is_wrong_is_said(trained: Trained, tmp_path: Path) -> None:
    """Bars that are too narrow in some tenth, and a fit that is not positive at three runs."""
    best, other = trained.surrogates
    narrow = replace(best, bars=replace(best.bars, quantile=0.3 * best.bars.quantile))
    wrong = trained.predicted["trigonometric"].copy()
    wrong[:3] *= -1.0
    predicted = {**trained.predicted, "trigonometric": wrong}
    said = text(written(replace(trained, surrogates=(narrow, other), predicted=predicted), tmp_path / "out"))
    assert re.search(r"In tenth \d+ the bars are too narrow, by more than chance", said)
    assert "trigonometric gives no positive value at 3 runs, which are left out" in said
    # Three runs do not move the 95th percentile.
    assert "trigonometric: the largest error of the uniform runs, 200 %, is at q2" in said


def test_an_index_has_its_own_name_and_unit(tmp_path: Path) -> None:
    ratio = (Quantity("isotropy", "1", "isotropy, weakest / strongest"), lambda q: 1.5 + np.cos(3.0 * q[:, 1]))
    result = learned(scalar=ratio)
    said = text(written(result, tmp_path / "out"))
    assert "Relative errors of the isotropy on runs kept out" in said
    assert re.search(r"The answer to the first: isotropy \d", said)
    assert "stiffarm map" not in said
    assert "N/mm" not in said


def test_parts_and_widths_of_a_known_error() -> None:
    """Errors of 0 to 1 evenly, bars of 0.95 everywhere: 95 % inside; the error grows along x."""
    n = 18_000
    error = (np.arange(n) + 0.5) / n
    row = JudgedBars("x", error, np.full(n, 0.95))
    assert row.inside == pytest.approx(0.95)
    assert sum(p.runs for p in parts(row)) == n
    x = np.concatenate([[0.0, 18.0], np.linspace(0.0, 17.0, n - 2)])
    middle, median, high = gathered(x, error)
    # The last of 18 widths holds two runs, which is too few.
    np.testing.assert_allclose(middle, np.arange(17) + 0.5)
    np.testing.assert_allclose(median, (np.arange(17) + 0.5) / 17.0, atol=2e-3)  # ten of 18 000 runs
    np.testing.assert_allclose(high, (np.arange(17) + 0.95) / 17.0, atol=2e-3)
    # Binomial, n = 1000: sqrt(0.95 * 0.05 / 1000) = 0.00689.
    assert chance(1000) == pytest.approx(1.96 * 0.00689, rel=1e-3)


def test_axes_have_labels_with_units() -> None:
    rng = np.random.default_rng(0)
    row = JudgedBars("x", np.abs(rng.normal(size=500)), np.full(500, 1.96))
    left, right = error_bars_figure([row]).axes
    assert left.get_xlabel() == "error / half-width of its 95 % bar (–)"
    assert (left.get_ylabel(), right.get_ylabel()) == ("runs with a larger ratio (%)", "inside the bars (%)")
    figure = error_over_inputs_figure([row], ("q2_deg", "q3real_deg", "q4_deg"), rng.uniform(size=(500, 3)))
    assert [ax.get_xlabel() for ax in figure.axes] == ["q2 (deg)", "q3real (deg)", "q4 (deg)"]
    assert figure.axes[0].get_ylabel() == "relative error (%)"


def test_fit_writes_it_and_names_it(tmp_path: Path) -> None:
    options = ("--inputs", "q2_deg,q3_deg", "--basis", "polynomial", "--degree", "3", "--runs", "200")
    with fewer_runs(), blank_pictures():
        outcome = run_here("fit", "kr60-3", *options, "--links", "rigid", "--json", "--out", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert outcome.json["files"] == ["surrogate.json"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    (s,) = outcome.json["surrogates"]
    assert rows(page, "Relative errors of")[2][1] == relative(s["rms_relative_error"]).replace("\u00a0", " ")
    assert page.count("data:image/png") == 4
