"""What a published stiffness map says about a robot, checked on a model's own poses, with verdicts.

The claims are those of Gotlih, Karner, Gotlih and Brezocnik, "Experiment based structural stiffness calibration of a
virtual robot model", section 3, about the ACMA XR701; they are put so that they can be asked of any arm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import spearmanr

from doe.planning.pose_designs import pose_design
from fem import ArmModel, directional_stiffness
from robots import InputError, Robot, forward_kinematics, tool_position
from robots.arrays import Array, Bools, Indices
from robots.progress import Progress
from surrogate import default_sweep

POSES: Final = 20_000
# Poses at which the other coordinates are kept while one moves, and its values.
KEPT: Final = 1_500
LEVELS: Final = 9
# A coordinate that takes all its values at so many of the settings is free of the others.
FREE: Final = 0.9


@dataclass(frozen=True, eq=False)
class PoseSample:
    """Poses spread evenly over the joint ranges, n of them.

    Parameters
    ----------
    points : (n, 3) m, tool points; joint 1 stands still, because turning about the main axis changes nothing
    stiffness : (n,) N/m
    stretch : (n,) m, distance from the shoulder (joint 2) to the tool point
    """

    points: Array
    stiffness: Array
    stretch: Array

    @property
    def radius(self) -> Array:
        """Distance (n,) m from the base's z axis."""
        return np.asarray(np.hypot(self.points[:, 0], self.points[:, 1]))


@dataclass(frozen=True, eq=False)
class LayerSample:
    """One coordinate moved alone: stiffness (m, k) N/m at m settings of the others, NaN where it cannot be taken."""

    coordinate: str
    levels_deg: Array
    stiffness: Array


@dataclass(frozen=True, eq=False)
class Samples:
    """All that the findings rest on; ``layers``: every swept coordinate moved alone, the layer coordinate first."""

    poses: PoseSample
    layers: tuple[LayerSample, ...]
    layer: str | None


def sample_model(model: ArmModel, n: int = POSES, seed: int = 0, progress: Progress | None = None) -> Samples:
    """Evaluate a model at poses spread by a Sobol sequence over its joint ranges, under a vertical load.

    The coordinates of :func:`surrogate.default_sweep` vary, the others stand at 0 or at the limit nearest to it.

    Raises
    ------
    InputError
        A rigid model, or hardly any pose that can be taken.
    """
    robot = model.robot
    swept, layer = default_sweep(robot)
    varied = ((layer,) if layer else ()) + swept
    rng = np.random.default_rng(seed)
    q = pose_design(robot, n, "sobol", coordinates=varied, rng=rng)
    frames = forward_kinematics(robot, q)
    points = tool_position(robot, frames)
    # frames.p[:, 0] is the base, [:, 2] the body that joint 2 moves: its origin lies on joint 2.
    shoulder = frames.p[:, min(2, robot.dof)]
    poses = PoseSample(points, directional_stiffness(model, q), np.linalg.norm(points - shoulder, axis=1))
    layers = []
    for k, name in enumerate(varied):
        layers.append(_moved_alone(model, q[: min(KEPT, n)], name))
        if progress is not None:
            progress(k + 1, len(varied))
    return Samples(poses, tuple(layers), layer)


def _moved_alone(model: ArmModel, q: Array, name: str) -> LayerSample:
    robot: Robot = model.robot
    j = robot.coordinate_index(name)
    low, high = robot.limits[j]
    # The middles of equal parts: an evenly spread coordinate, without giving its ends extra weight.
    levels = low + (np.arange(LEVELS) + 0.5) / LEVELS * (high - low)
    moved = np.repeat(q[:, None], LEVELS, axis=1)
    moved[..., j] = levels
    flat = moved.reshape(-1, robot.dof)
    reached = robot.reachable(flat)
    stiffness = np.full(len(flat), np.nan)
    if reached.any():
        stiffness[reached] = directional_stiffness(model, flat[reached])
    return LayerSample(name, np.degrees(levels), stiffness.reshape(len(q), LEVELS))


@dataclass(frozen=True)
class Influence:
    """How much a coordinate matters, all of the logarithm of stiffness: variance shares and relative changes.

    ``main``: share of the variance that its mean effect explains; ``total``: share that is lost without it (both as of
    Sobol; Saltelli et al. 2010, doi:10.1016/j.cpc.2009.09.018). ``change_*``: largest over smallest stiffness, less 1,
    when it alone moves: median and 95th percentile over the settings of the others. ``main`` is NaN where a coupling
    ties the coordinate to others: its mean effect would be theirs too, and ``total`` is of the range that it has left.
    """

    main: float
    total: float
    change_median: float
    change_p95: float


def influence(layer: LayerSample, variance: float) -> Influence:
    """Influence of a coordinate; ``variance``: that of the logarithm of stiffness over all poses.

    Settings at which the coordinate cannot take all its values count with those it can.
    """
    logs = np.log(layer.stiffness)
    movable = np.isfinite(logs).sum(axis=1) >= 2
    if not movable.any():
        return Influence(0.0, 0.0, 0.0, 0.0)
    some, count = logs[movable], np.isfinite(logs[movable]).sum(axis=1)
    # The levels are middles of equal parts: of a straight line over m parts they miss 1 / m^2 of the variance.
    within = np.nanvar(some, axis=1) * count**2 / (count**2 - 1)
    whole = logs[np.isfinite(logs).all(axis=1)]
    main = float("nan")
    if len(whole) >= FREE * len(logs):
        main = float(np.var(whole.mean(axis=0))) * whole.shape[1] ** 2 / (whole.shape[1] ** 2 - 1)
    change = np.exp(np.nanmax(some, axis=1) - np.nanmin(some, axis=1)) - 1.0
    median, high = np.percentile(change, [50.0, 95.0])
    return Influence(main / variance, float(within.sum()) / len(logs) / variance, float(median), float(high))


def influences(samples: Samples) -> dict[str, Influence]:
    """Influence of every swept coordinate, by name."""
    variance = float(np.var(np.log(samples.poses.stiffness)))
    return {layer.coordinate: influence(layer, variance) for layer in samples.layers} if variance > 0.0 else {}


Verdict = Literal["holds", "holds in part", "does not hold", "cannot be told"]

# Rank correlations: below -0.5 is what Cohen (1988) calls a large effect, above -0.3 less than a medium one, and
# within 0.1 less than a small one.
STRONG: Final = -0.5
WEAK: Final = -0.3
NONE: Final = 0.1
# A neighbourhood as wide as a machined part. Its range of stiffness is large where 150 mm change as much as half of all
# there is: the logarithm of its ratio of percentiles against that of the whole.
NEIGHBOURHOOD_M: Final = 0.15
LARGE_SHARE: Final = 0.5
# "There are regions": a tenth of the places, more than stray points and less than the rule.
SOME_PLACES: Final = 0.1
MOST_CENTRES: Final = 800
LEAST_NEIGHBOURS: Final = 20
LEAST_CENTRES: Final = 30
# "Almost without influence": its mean effect, which the paper drew, and all its effects, which a surrogate without it
# would lose, are each at most 1 % of the variance (R2 stays at 0.99) ...
LITTLE_VARIANCE: Final = 0.01
# ... and moving it alone changes the stiffness by at most 10 % in half of the poses (a convention).
LITTLE_CHANGE: Final = 0.10
# Below this ratio of 95th to 5th percentile there is nothing to be stiff or soft about.
LEAST_RANGE: Final = 1.05


@dataclass(frozen=True)
class Finding:
    """One claim about a map and what this model says to it.

    ``figures``: numbers behind the verdict by name; ``thresholds``: what they were held against, with the reason;
    ``sentence``: the verdict in plain words.
    """

    key: str
    claim: str
    verdict: Verdict
    figures: Mapping[str, float] = field(default_factory=dict)
    thresholds: str = ""
    sentence: str = ""


class LocalRanges(NamedTuple):
    """Around k poses: their rows, the ratio of the 95th to the 5th percentile, whether both end tenths are there."""

    rows: Indices
    ratio: Array
    both_tenths: Bools


def findings(samples: Samples) -> list[Finding]:
    """Check the paper's three findings on a model's samples (see :func:`sample_model`)."""
    return [distance_finding(samples.poses), neighbour_finding(samples.poses), layer_finding(samples)]


def spread_ratio(stiffness: Array) -> float:
    """95th over 5th percentile of stiffness (n,)."""
    low, high = np.percentile(stiffness, [5.0, 95.0])
    return float(high / low)


def _uniform(stiffness: Array) -> str:
    ratio = spread_ratio(stiffness)
    if ratio >= LEAST_RANGE:
        return ""
    return f"the stiffness hardly varies at all (95th over 5th percentile {ratio:.3f})"


def _untold(key: str, claim: str, why: str) -> Finding:
    return Finding(key, claim, "cannot be told", sentence=f"This cannot be told: {why}.")


def distance_finding(poses: PoseSample) -> Finding:
    """Whether stiffness falls with the distance from the main axis and with the arm's stretch (rank correlations)."""
    key, claim = "distance", "low stiffness far from the main Z axis and at large stretch"
    why = _uniform(poses.stiffness)
    if not why and min(np.ptp(poses.radius), np.ptp(poses.stretch)) < 1e-6:
        why = "the tool keeps its distance from the axis or from the shoulder in all poses"
    if why:
        return _untold(key, claim, why)
    by = {"radius": poses.radius, "stretch": poses.stretch}
    rho = {name: float(spearmanr(values, poses.stiffness).statistic) for name, values in by.items()}
    ratio = {name: _outer_over_inner(values, poses.stiffness) for name, values in by.items()}
    strong, weak = [r <= STRONG for r in rho.values()], [r > WEAK for r in rho.values()]
    verdict: Verdict = "holds" if all(strong) else "does not hold" if all(weak) else "holds in part"
    words = (
        f"Stiffness {_tendency(rho['radius'])} with the distance from the main axis (rank correlation "
        f"{rho['radius']:+.2f}; the outermost third has {ratio['radius']:.2f} times the median of the innermost) and "
        f"{_tendency(rho['stretch'])} with stretch ({rho['stretch']:+.2f}, {ratio['stretch']:.2f} times)."
    ).replace("-", "−")
    figures = {f"rank_correlation_{name}": value for name, value in rho.items()}
    figures |= {f"outer_over_inner_third_{name}": value for name, value in ratio.items()}
    limits = (
        f"holds: both rank correlations at most {STRONG} (a large effect after Cohen); does not hold: both above "
        f"{WEAK} (less than a medium one)"
    )
    return Finding(key, claim, verdict, figures, limits, words)


def _tendency(rho: float) -> str:
    if rho <= STRONG:
        return "falls clearly"
    if rho <= WEAK:
        return "tends to fall"
    if abs(rho) < NONE:
        return "hardly changes"
    return "falls weakly" if rho < 0.0 else "rises"


def _outer_over_inner(values: Array, stiffness: Array) -> float:
    low, high = np.quantile(values, [1 / 3, 2 / 3])
    return float(np.median(stiffness[values >= high]) / np.median(stiffness[values <= low]))


def neighbour_finding(poses: PoseSample, neighbourhood: float = NEIGHBOURHOOD_M) -> Finding:
    """Whether soft and stiff points lie close together in the middle third of the reach.

    Around points of the middle third, balls of radius ``neighbourhood`` (m): the ratio of the 95th to the 5th
    percentile of stiffness in each, as a logarithm over that of the whole; and how many hold both of the end tenths.
    """
    key, claim = "neighbours", "soft and stiff regions close together in the middle of the workspace"
    why = _uniform(poses.stiffness)
    if why:
        return _untold(key, claim, why)
    middle = middle_of_reach(poses)
    found = local_ranges(poses, np.flatnonzero(middle), neighbourhood)
    inner = found.ratio
    if len(inner) < LEAST_CENTRES:
        return _untold(
            key, claim, f"only {len(inner)} places in the middle third of the reach have enough poses around them"
        )
    outer, both = local_ranges(poses, np.flatnonzero(~middle), neighbourhood).ratio, float(found.both_tenths.mean())
    whole = spread_ratio(poses.stiffness)
    shares = np.log(inner) / np.log(whole)
    share, contrasts = float(np.median(shares)), float(np.mean(shares >= LARGE_SHARE))
    verdict: Verdict = "does not hold"
    if share >= LARGE_SHARE or both >= SOME_PLACES:
        verdict = "holds"
    elif contrasts >= SOME_PLACES:
        verdict = "holds in part"
    elsewhere = float(np.median(outer)) if len(outer) else float("nan")
    words = (
        f"Within {1e3 * neighbourhood:.0f} mm of a place in the middle third of the reach, the stiffness ranges over a "
        f"factor of {np.median(inner):.2f} (median; elsewhere {elsewhere:.2f}), against {whole:.2f} over the whole "
        f"workspace; around {_percent(contrasts)} of these places it ranges over half of that or more (as logarithms), "
        f"and around {_percent(both)} there are poses of both the softest and the stiffest tenth."
    )
    figures = {
        "local_ratio_middle": float(np.median(inner)),
        "local_ratio_elsewhere": elsewhere,
        "whole_ratio": whole,
        "share_of_log_range": share,
        "places_with_half_the_range": contrasts,
        "places_with_both_tenths": both,
        "places": float(len(inner)),
    }
    limits = (
        f"holds: in the median place the local range is at least {LARGE_SHARE:g} of the whole (as logarithms), or "
        f"{_percent(SOME_PLACES)} of the places have both end tenths around them; in part: such a range around "
        f"{_percent(SOME_PLACES)} of the places (there are such regions); chance alone would give 1"
    )
    return Finding(key, claim, verdict, figures, limits, words)


def local_ranges(poses: PoseSample, rows: Indices, radius: float = NEIGHBOURHOOD_M) -> LocalRanges:
    """Ranges of stiffness in balls of ``radius`` (m) around some of the poses ``rows`` that have enough others near."""
    centres = rows[:: max(1, len(rows) // MOST_CENTRES)]
    around = [np.asarray(one) for one in cKDTree(poses.points).query_ball_point(poses.points[centres], radius)]
    enough = np.array([len(one) >= LEAST_NEIGHBOURS for one in around], dtype=bool)
    values = [poses.stiffness[one] for one, ok in zip(around, enough, strict=True) if ok]
    low, high = np.percentile(poses.stiffness, [10.0, 90.0])
    both = np.array([bool((v <= low).any() and (v >= high).any()) for v in values], dtype=bool)
    return LocalRanges(centres[enough], np.array([spread_ratio(v) for v in values]), both)


def middle_of_reach(poses: PoseSample) -> Bools:
    """Which poses (n,) have the tool in the middle third of the distances from the main axis that are reached."""
    # Not by single stray poses.
    low, high = np.percentile(poses.radius, [1.0, 99.0])
    share = (poses.radius - low) / max(float(high - low), 1e-12)
    return np.asarray((share >= 1 / 3) & (share <= 2 / 3))


def layer_finding(samples: Samples) -> Finding:
    """Whether the coordinate that leaves the plane of the cross-section (q4 of six) hardly matters."""
    key = "layer"
    if samples.layer is None:
        return _untold(key, "q4 almost without influence", "this arm has no joint that plays the part of q4")
    name = samples.layer.removesuffix("_deg")
    claim = f"{name} almost without influence"
    why = _uniform(samples.poses.stiffness)
    if why:
        return _untold(key, claim, why)
    by_name = influences(samples)
    own = by_name[samples.layer]
    rank = sorted(by_name, key=lambda n: -by_name[n].total).index(samples.layer) + 1
    tied = not np.isfinite(own.main)
    little = tied or own.main <= LITTLE_VARIANCE, own.total <= LITTLE_VARIANCE, own.change_median <= LITTLE_CHANGE
    verdict: Verdict = "holds" if all(little) else "holds in part" if any(little) else "does not hold"
    alone = "only what its coupling lets it" if tied else _percent(own.main)
    words = (
        f"On average over all poses {name} explains {alone} of the variance of the (logarithmic) stiffness; with all "
        f"that it does together with other joints, {_percent(own.total)}. Moved alone it changes "
        f"stiffness by {_percent(own.change_median)} in the median pose, by {_percent(own.change_p95)} or more in one "
        f"of twenty; by its total effect it is number {rank} of {len(by_name)} coordinates."
    )
    figures = {
        "total_effect": own.total,
        "main_effect": own.main,
        "relative_change_median": own.change_median,
        "relative_change_95_percent": own.change_p95,
        "rank_among_coordinates": float(rank),
    } | {f"total_effect_{n.removesuffix('_deg')}": one.total for n, one in by_name.items() if n != samples.layer}
    limits = (
        f"holds: mean and total effect at most {_percent(LITTLE_VARIANCE)} of the variance (a surrogate without {name} "
        f"keeps an R² of 0.99) and a median change of at most {_percent(LITTLE_CHANGE)} when it moves alone (a "
        "convention); in part: some of these"
    )
    return Finding(key, claim, verdict, figures, limits, words)


def _percent(value: float) -> str:
    return f"{100.0 * value:.2g}\u00a0%" if value < 0.995 else f"{100.0 * value:.0f}\u00a0%"


def model_findings(
    model: ArmModel, n: int = POSES, seed: int = 0, progress: Progress | None = None
) -> tuple[Samples | None, list[Finding]]:
    """Sample a model and check the findings; a model that cannot be sampled gets the verdict with the reason."""
    try:
        samples = sample_model(model, n, seed, progress)
    except InputError as error:
        claims = {
            "distance": "low stiffness far from the main Z axis and at large stretch",
            "neighbours": "soft and stiff regions close together in the middle of the workspace",
            "layer": "q4 almost without influence",
        }
        return None, [_untold(key, claim, str(error).rstrip(".")) for key, claim in claims.items()]
    return samples, findings(samples)
