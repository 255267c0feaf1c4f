from __future__ import annotations

import functools
import itertools
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from figure_texts import Seen, texts
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

import robots
from doe import Measurements, PoseEffects, SpringPoints, bundled_data, fit_law, read_measurements
from doe.calibration.laws import study_curves
from doe.estimation.campaign import Stage
from doe.published.parametric import PoseFit
from doe.published.pose_studies import PoseStudies
from doe.tables.notes import DoubtfulReadings
from robots import InputError
from stiffarm.commands.calibrate.figures.identifiability import intervals_figure
from stiffarm.commands.calibrate.figures.laws import laws_figure
from stiffarm.commands.fit.figures import effects as figures_surrogate
from stiffarm.commands.fit.figures.effects import HeldOut
from stiffarm.commands.run import figures as figures_readings
from stiffarm.commands.sensitivity.figures import sensitivity_figure
from stiffarm.pages.bars import bars_figure
from stiffarm.pages.figure_parts import MARKERS, SERIES, joint_colour, paler, power_of_ten
from stiffarm.pages.style import save_png
from surrogate.main_effects import main_effects
from tests.stiffarm.made_estimates import made_spring

# Some fifty pictures are drawn.
pytestmark = pytest.mark.slow

ROBOT = robots.load_robot("xr701")
DATA = read_measurements(bundled_data("xr701"), ROBOT)
POSES = ("3", "4", "5", "39", "40", "41", "75", "76", "77")
MEASURED = DATA.displacement[DATA.loads_N == 650.0, 2] * 1e3
INF, NAN = float("inf"), float("nan")
# The report shows a figure 900 pixels wide; smaller type than this is hard to read there.
SHOWN_WIDTH_PX, LEAST_TYPE_PX = 900.0, 9.0


def effects(pose: str, *values: float) -> PoseEffects:
    array = np.array(values)
    return PoseEffects(pose, 2, ("j2", "j3", "j4", "j5"), array, np.abs(array) / np.abs(array).sum(), np.zeros(16))


def data() -> Figure:
    doubts = (
        DoubtfulReadings(("3", "4"), (375,), "outlier?"),
        DoubtfulReadings(("39", "40"), (375, 650), "swapped?"),
    )
    return figures_readings.data_figure(
        DATA, excluded_loads_N=(150, 375), doubts=doubts, families=figures_readings.wrist_families(DATA, ROBOT)
    )


def data_with_long_labels() -> Figure:
    return figures_readings.data_figure(replace(DATA, pose=tuple(f"corner {pose}" for pose in DATA.pose)))


def match_with_long_labels() -> Figure:
    return figures_readings.match_figure([f"far corner {pose}" for pose in POSES], MEASURED, {"one": MEASURED + 0.1})


def sensitivity() -> Figure:
    study = {
        "parallelogram": [effects("5", 2.33, 13.1, 0.0, 0.49), effects("41", 0.05, 12.8, 0.0, -0.5)],
        "serial": [effects("5", 4.39, 13.1, 0.0, 0.49)],
    }
    return sensitivity_figure(study, (1e5, 1e6))


def match(worst_mm: float = 0.1) -> Figure:
    wave = 0.05 * np.sin(np.arange(9.0))
    off = MEASURED - wave[::-1]
    off[5] = MEASURED[5] - worst_mm
    return figures_readings.match_figure(POSES, MEASURED, {"one": MEASURED + wave, "two": off})


ERRORS = {"fit": {"constant": 0.054, "staged": 0.05}, "left out": {"constant": 0.074, "staged": 1.049}}


def bars() -> Figure:
    return bars_figure("Fit and prediction", ERRORS, "RMS error (mm)")


def many_bars() -> Figure:
    """As a calibration draws them: more names than can be written, one of them without a value."""
    one = {f"corner {i}": 0.05 + 1e-4 * i for i in range(60)} | {"corner 7": NAN}
    return bars_figure("", {"fitted": one, "held out": {"far": 0.1}}, "RMS error (mm)", "pose", {"noise": 0.06})


SPRINGS = (
    made_spring("j2", 1.45e6, (0.94e6, 3.19e6), "determined"),
    made_spring("j3", 0.84e6, (0.05e6, INF), "one-sided"),
    made_spring("j4", 1e9, (0.36e6, INF), "at bound"),
    made_spring("j5", NAN, (NAN, NAN), "not identified"),
)


def springs() -> Figure:
    spare = (made_spring("j2", 1.5e6, (NAN, NAN), "determined"),)
    return intervals_figure({"parallelogram": SPRINGS, "serial": spare}, expected=(1e5, 1e6))


def rigid_joints() -> Figure:
    measured = {"5": 2.05, "41": 1.88, "77": 2.14}
    series = {"measured": measured} | {
        name: {pose: dz / by for pose, dz in measured.items()} for name, by in (("beam", 20.0), ("published", 9300.0))
    }
    return bars_figure("Rigid joints", series, "deflection |dz| (mm)", "pose", log=True)


def response_surfaces() -> Figure:
    origin = ("calibrated", "calibrated", "mirrored", "mirrored", "held")
    near, far = {}, {}
    for joint, name, angles in (("j2", "q2_deg", (-35, 5, 45)), ("j3", "q3real_deg", (40, 77.5, 115))):
        stiffness = np.array([5e5, 8e5, 6e5])
        near[joint] = SpringPoints(joint, (name,), np.radians([angles]).T, stiffness, ("calibrated",) * 3)
    for joint, name, end in (("j5", "q5_deg", 100), ("j4", "q4_deg", 200)):
        angles_deg = np.array([[-end, -35], [-end, 45], [end, -35], [end, 45], [0, 5]])
        stiffness = np.array([2e3, 2e4, 2e3, 2e4, 1e6])
        far[joint] = SpringPoints(joint, (name, "q2_deg"), np.radians(angles_deg), stiffness, origin)
    return laws_figure(study_curves([studied(near), studied(far)], ROBOT))


def studied(points: dict[str, SpringPoints]) -> PoseStudies:
    """Springs matched pose by pose, each within a factor of two, and the laws through them."""
    fits = []
    for k in range(next(iter(points.values())).origin.count("calibrated")):
        stiffness = np.array([p.stiffness[k] for p in points.values()])
        ends = np.column_stack([stiffness / 2, stiffness * 2])
        fits.append(PoseFit(str(k), tuple(points), stiffness, 0.0, 0.0, 1, 1, True, (), ends))
    laws = {joint: fit_law(ROBOT, p, 6, "test") for joint, p in points.items()}
    return PoseStudies(Stage(name="one", parameters=("j2.stiffness",)), tuple(fits), points, laws)


def effects_of_angles() -> Figure:
    q = np.array(list(itertools.product([-35.0, 5, 45], [40.0, 77.5, 115], [-200.0, 0, 200], [-100.0, 0, 100])))
    stiffness = 300.0 + 200.0 * np.cos(np.radians(q)).sum(axis=1) ** 2
    return figures_surrogate.main_effects_figure(
        main_effects(q, stiffness, ("q2_deg", "q3real_deg", "q4_deg", "q5_deg"))
    )


def held_out(name: str, spread: float) -> HeldOut:
    rng = np.random.default_rng(0)
    true = np.exp(rng.uniform(np.log(200.0), np.log(2000.0), 500))
    return HeldOut(name, true, true * np.exp(spread * rng.standard_normal(500)))


def surrogate_quality() -> Figure:
    return figures_surrogate.surrogate_quality_figure(
        [held_out("polynomial, degree 6", 0.07), held_out("log", 0.05), held_out("exact", 1e-14)]
    )


def surrogate_quality_of_one() -> Figure:
    return figures_surrogate.surrogate_quality_figure([held_out("polynomial", 0.07)])


FIGURES: dict[Callable[[], Figure], tuple[str, ...]] = {
    data: ("(mm)", "(N)"),
    data_with_long_labels: ("(mm)", "(N)"),
    match_with_long_labels: ("(mm)",),
    sensitivity: ("(mm)", "N m/rad"),
    match: ("deflection |dz| (mm)", "measured (mm)"),
    bars: ("(mm)",),
    many_bars: ("(mm)",),
    springs: ("1e6 N m/rad",),
    rigid_joints: ("(mm)",),
    response_surfaces: ("stiffness (N m/rad)", "q2 (deg)", "q3real (deg)"),
    effects_of_angles: ("q2 (deg)", "q3real (deg)", "(–)"),
    surrogate_quality: ("true stiffness (N/mm)", "predicted stiffness (N/mm)", "(%)"),
    surrogate_quality_of_one: ("true stiffness (N/mm)", "(%)"),
}
every_figure = pytest.mark.parametrize("make", FIGURES, ids=lambda make: make.__name__)


@functools.cache
def drawn(make: Callable[[], Figure]) -> tuple[Figure, list[Seen]]:
    """Draw once for the tests that only look."""
    figure = make()
    return figure, texts(figure)


def words(figure: Figure) -> str:
    return "\n".join(seen.text for seen in texts(figure))


def label_of(ax: Axes) -> str:
    return ax.get_xlabel()


@every_figure
def test_it_renders_without_a_warning_and_names_its_units(make: Callable[[], Figure], tmp_path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure, seen = make(), drawn(make)[1]
        save_png(figure, tmp_path / "figure.png")
    for unit in FIGURES[make]:
        assert any(unit in one.text for one in seen)
    image = plt.imread(tmp_path / "figure.png")
    assert image[..., :3].std() > 0.05  # not a blank page: its standard deviation is 0
    assert plt.get_fignums() == []


@every_figure
def test_every_axis_says_what_it_measures(make: Callable[[], Figure]) -> None:
    """Each axis with numbers on it has a label with its unit, or shares that of its row or of the figure."""
    figure, _ = drawn(make)
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis, *([ax.zaxis] if isinstance(ax, Axes3D) else [])):
            ticks = [label.get_text().lstrip("$−") for label in axis.get_ticklabels()]
            names = any(text and not text[0].isdigit() for text in ticks) or axis.get_label_text().startswith("pose")
            place = ax.get_subplotspec()
            shared = axis is ax.yaxis and place is not None and place.colspan.start > 0
            if any(ticks) and not names and not shared:
                assert "(" in axis.get_label_text() + figure.get_supxlabel(), ticks


@every_figure
def test_nothing_is_cut_off(make: Callable[[], Figure]) -> None:
    figure, seen = drawn(make)
    for one in seen:
        # One pixel: glyphs are placed on whole pixels.
        assert min(one.box.x0, one.box.y0) >= -1, one
        assert max(one.box.x1 - figure.bbox.x1, one.box.y1 - figure.bbox.y1) <= 1, one


@every_figure
def test_no_text_lies_on_another(make: Callable[[], Figure]) -> None:
    # The box of a tilted text (labels of 3-D axes) is much larger than the text.
    upright = [one for one in drawn(make)[1] if one.rotation % 90 == 0]
    for one, other in itertools.combinations(upright, 2):
        wide = min(one.box.x1, other.box.x1) - max(one.box.x0, other.box.x0)
        high = min(one.box.y1, other.box.y1) - max(one.box.y0, other.box.y0)
        # Boxes have empty margins of a few pixels above and below the glyphs at 150 dots an inch.
        assert wide < 2 or high < 5, (one, other)


@every_figure
def test_type_can_be_read_in_the_report(make: Callable[[], Figure]) -> None:
    figure, seen = drawn(make)
    smallest = min(seen, key=lambda one: one.size)
    assert smallest.size * SHOWN_WIDTH_PX / figure.get_figwidth() / 72.0 >= LEAST_TYPE_PX, smallest


def test_data_in_doubt_are_hatched_and_unused_loads_pale() -> None:
    bars = data().axes[0].patches
    assert len(bars) == 27
    hatched = [i for i, bar in enumerate(bars) if bar.get_hatch()]
    # Poses 3, 4, 39, 40 are the bars 0, 1, 3, 4 of a load; 375 N is the second load, 650 N the third.
    assert hatched == [9, 10, 12, 13, 21, 22]
    full, pale = to_hex(bars[18].get_facecolor()), to_hex(bars[0].get_facecolor())
    assert (full, pale) == (SERIES[0].lower(), paler(SERIES[0]))
    assert bars[18].get_height() == pytest.approx(1.46, rel=1e-12)  # text -> m -> mm is exact to round-off


def test_repeats_are_drawn_as_their_mean() -> None:
    doubled = DATA.select(np.isin(np.array(DATA.pose), ["5"]) & (DATA.loads_N == 650.0))
    twice = read_measurements(bundled_data("xr701"), ROBOT).select(
        np.isin(np.array(DATA.pose), ["5", "41"]) & (DATA.loads_N == 650.0)
    )
    object.__setattr__(twice, "pose", ("5", "5"))
    heights = [figures_readings.data_figure(d).axes[0].patches[0].get_height() for d in (doubled, twice)]
    assert heights == pytest.approx([2.05, (2.05 + 1.88) / 2], rel=1e-12)  # round-off of unit changes


def test_a_small_effect_is_written_though_its_bar_cannot_be_seen() -> None:
    seen = words(sensitivity())
    for value in ("+13.1", "+0.05", "−0.5", "not studied"):
        assert value in seen


def test_match_axis_leaves_out_a_far_outlier_and_says_so() -> None:
    near, far = match(0.1), match(3.0)
    assert near.axes[1].get_ylim()[1] == pytest.approx(0.115)  # 1.15 times the largest residual
    # The axis ends above the other residuals (0.05 mm), not at 3 mm.
    assert far.axes[1].get_ylim()[1] < 0.1
    assert "+3.00" in words(far)
    assert "arrows: beyond the axis" in label_of(far.axes[1])
    assert "arrows" not in label_of(near.axes[1])


def test_match_residual_is_positive_where_the_model_is_too_soft() -> None:
    figure = figures_readings.match_figure(POSES, MEASURED, {"soft": 1.1 * MEASURED, "none": np.full(9, NAN)})
    points = next(line for line in figure.axes[1].lines if line.get_marker() == MARKERS[0])
    assert np.asarray(points.get_ydata()) == pytest.approx(0.1 * np.abs(MEASURED), rel=1e-9)  # round-off
    assert "none: not predicted" in words(figure)


def test_a_bar_far_longer_than_the_others_is_cut_and_says_so() -> None:
    ax = bars().axes[0]
    assert ax.get_ylim()[1] < 0.1
    assert "leaves the axis" in ax.get_ylabel()
    assert "1.0490 ↑" in words(bars())
    even = bars_figure("", {"fit": {"a": 0.05, "b": 0.06}, "left out": {"a": 0.07, "b": NAN}}, "RMS error (mm)")
    assert "axis" not in even.axes[0].get_ylabel()
    assert "–" in words(even), "not predicted"
    # An exact fit has a scale of its own.
    assert bars_figure("", {"fit": {"a": 0.0}}, "RMS error (mm)").axes[0].get_ylim()[1] > 0.0


def test_what_a_spring_estimate_says() -> None:
    seen = words(springs())
    for text in (
        "1.45 (0.940 to 3.19)",
        "0.840 (>= 0.0500)",
        "at its bound: rigid fits best (>= 0.360)",
        "Not identified, so without an interval: j5.stiffness",
        "1.50 (no spare reading)",
    ):
        assert text in seen
    # A spring at its bound (1000) must not stretch the axis: its value means nothing.
    assert springs().axes[0].get_xlim()[1] < 10.0


def test_bars_over_four_decades_are_all_written() -> None:
    seen = words(rigid_joints())
    assert {"2.05", "0.102", "0.00022"} <= set(seen.split())


def test_laws_pass_through_their_points_and_invent_no_second_axis() -> None:
    curve, _, wrist, _ = drawn(response_surfaces)[0].axes
    law = curve.lines[0]
    assert curve.get_yscale() == "log"
    # The law goes through its points (tested in doe); here: between curve samples 0.4 deg apart.
    assert np.interp(5.0, law.get_xdata(), law.get_ydata()) == pytest.approx(8e5, rel=1e-3)
    # Calibrated at one angle of the wrist and two of joint 2: a curve over joint 2, for that angle alone.
    (law,) = [line for line in wrist.lines if str(line.get_label()).startswith("law")]
    assert wrist.get_xlabel() == "q2 (deg)"
    ends = np.interp([-35.0, 45.0], law.get_xdata(), law.get_ydata())
    # Ends of the law are the outermost grid points.
    assert ends == pytest.approx([2e3, 2e4], rel=1e-6)


def test_relative_error_is_that_of_the_compliance() -> None:
    row = HeldOut("x", np.array([100.0, 100.0]), np.array([50.0, 200.0]))
    assert row.relative_error == pytest.approx([1.0, 0.5], rel=1e-15)  # exact in binary


def test_a_surrogate_exact_to_round_off_is_named_not_drawn() -> None:
    seen = words(surrogate_quality())
    assert seen.count("(left of the axis)") == 1
    assert "exact: RMS" in seen


# Even numbers of dollars would be taken for mathematics; "_x}" is none that matplotlib could read.
SIGNS = ("$x_$", "_y}$ & <b>$", "$10")


def _relabelled() -> Measurements:
    rows = DATA.select(np.isin(np.array(DATA.pose), POSES[:3]))
    return replace(rows, pose=tuple(SIGNS[POSES.index(pose)] for pose in rows.pose))


HOSTILE: dict[str, Callable[[], Figure]] = {
    "data": lambda: figures_readings.data_figure(
        _relabelled(),
        doubts=(DoubtfulReadings(SIGNS, (650,), " ".join(SIGNS)),),
        families=dict(zip(SIGNS, SIGNS[::-1], strict=True)),
    ),
    "sensitivity": lambda: sensitivity_figure({sign: [effects(sign, 1.0, 2.0, 0.0, -1.0)] for sign in SIGNS}),
    "match": lambda: figures_readings.match_figure(
        SIGNS, MEASURED[:3], dict.fromkeys(SIGNS, MEASURED[:3] + 0.1), heading=" ".join(SIGNS)
    ),
    "bars": lambda: bars_figure(SIGNS[0], {SIGNS[1]: dict.fromkeys(SIGNS, 0.1)}, SIGNS[2]),
    "springs": lambda: intervals_figure({"a": [made_spring(sign, 1e6, (9e5, 2e6), "determined") for sign in SIGNS]}),
    "surrogate": lambda: figures_surrogate.surrogate_quality_figure([held_out(sign, 0.07) for sign in SIGNS]),
    "main effects": lambda: figures_surrogate.main_effects_figure({s: (np.arange(3.0),) + (ONES,) * 3 for s in SIGNS}),
}
ONES = np.ones(3)


@pytest.mark.parametrize("make", HOSTILE.values(), ids=HOSTILE)
def test_a_dollar_is_a_dollar(make: Callable[[], Figure], tmp_path: Path) -> None:
    """Names come from files: what looks like mathtext in them is written as it stands, and stops no picture."""
    figure = make()
    save_png(figure, tmp_path / "figure.png")
    seen = words(figure)
    # A figure of one pose or series shows the first sign, the others all of them.
    assert all(sign in seen for sign in SIGNS)


@every_figure
def test_no_figure_needs_mathtext(make: Callable[[], Figure]) -> None:
    assert not [one for one in drawn(make)[1] if "$" in one.text or "\\" in one.text]


def test_powers_of_ten_without_mathtext() -> None:
    assert [power_of_ten(v) for v in (1e5, 2e5, 1.5e6, 1.0, 0.003)] == ["10⁵", "2·10⁵", "1.5·10⁶", "10⁰", "3·10⁻³"]


def test_joints_keep_their_colour() -> None:
    assert joint_colour("j3") == joint_colour("A3") == SERIES[1]
    assert len({joint_colour(f"j{i}") for i in range(1, 7)}) == 6


nan9 = np.full(9, NAN)


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: sensitivity_figure({}), "no effects"),
        (lambda: figures_readings.match_figure(POSES, MEASURED[:3], {}), "measured_mm"),
        (lambda: figures_readings.match_figure(POSES, MEASURED, {"short": MEASURED[:3]}), "short"),
        (lambda: figures_readings.match_figure(POSES, nan9, {}), "finite"),
        (lambda: bars_figure("", {}, "RMS error (mm)"), "finite value"),
        (lambda: bars_figure("", {"x": {"a": NAN}}, "RMS error (mm)"), "finite value"),
        (lambda: bars_figure("", {"x": {"a": 1.0, "b": 0.0}}, "RMS error (mm)", log=True), "above 0"),
        (lambda: intervals_figure({}), "no estimates"),
        (lambda: laws_figure([]), "no laws"),
    ],
)
def test_bad_input_is_refused(make: Callable[[], Figure], names: str) -> None:
    with pytest.raises(InputError, match=names):
        make()


def test_data_without_dz_are_refused() -> None:
    blind = DATA.select(np.ones(DATA.n, dtype=np.bool_))
    blind.displacement[:] = NAN
    with pytest.raises(InputError, match="no translation was read"):
        figures_readings.data_figure(blind)
