"""What a user reads on the screen of a map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stiffarm.session.console import say, show_table

_OVER = {
    "joints": "map over joint angles",
    "slice": "map over a plane",
    "box": "map over a box",
    "cylinder": "map over a cylinder",
}


def show_map(content: Mapping[str, Any]) -> None:
    """Figures of a map of the arm."""
    rows, lines = [], list[str]()
    beyond = [found for found in content["quantities"].values() if "max_near_singular" in found]
    if beyond:
        lines.append("greatest: without poses near a singularity, where stiffness along one direction has no bound")
    for found in content["quantities"].values():
        if "min" in found:
            ends = [f"{found[key]:.4g}" for key in ("min", "median", "max")]
            rows.append([found["label"] + (f", {found['unit']}" if found["unit"] else ""), *ends])
        else:
            shares = sorted(found["share_of_points"].items(), key=lambda item: -item[1])
            if {name for name, _ in shares} == {"yes", "no"}:
                lines.append(f"{found['label']}: {100.0 * found['share_of_points']['yes']:.3g} % of the points")
                continue
            words = ", ".join(f"{name} {100.0 * share:.3g} %" for name, share in shares if share > 0.0)
            lines.append(f"{found['label']}: {words}")
    pose = "" if content["grid"] == "joints" else f": {content['pose']}"
    show_table(f"{_OVER[content['grid']]}{pose}", ["", "least", "median", "greatest"], rows)
    for line in lines:
        say(line)
    count = content["grid_points"]
    say(f"{count} {'point' if count == 1 else 'points'}, of which the arm can reach {content['points']}")
    check = content.get("search_check", {})
    if check.get("points"):
        say(
            f"check: a finer search at {check['points']} of these points finds poses that are at most "
            f"{check['worst_shortfall_percent']:.2g} % better"
        )


def show_index_map(content: Mapping[str, Any]) -> None:
    """Figures of an index over a grid, by gamma."""
    unit = "" if content["unit"] == "1" else f", {content['unit']}"

    def cell(value: float | None) -> str:
        return "" if value is None else f"{value:.4g}"

    rows = [
        [
            f"{one['gamma_deg']:g}",
            f"{100.0 * one['share_reached']:.4g} %",
            *(cell(one["reached"][name]) for name in ("mean", "standard_deviation", "peak_to_valley", "smallest")),
            cell(one["common"]["mean"]),
        ]
        for one in content["by_gamma"]
        if one["gamma_deg"] in content["drawn_gamma_deg"]
    ]
    columns = ["gamma, deg", "reached", "mean", "deviation", "peak to valley", "smallest", "mean, common points"]
    show_table(f"{content['quantity']} of the {content['robot']}{unit}", columns, rows)
    if len(rows) < len(content["by_gamma"]):
        say(f"(all {len(content['by_gamma'])} angles are in gamma_statistics.csv and with --json)")
    say(
        f"{content['points']} points, {content['points_reached']} reached at some gamma, "
        f"{content['points_every_gamma_reaches']} at every gamma"
    )
    best = content["best_gamma"]
    if best is None:
        say(f"note: no best gamma: {content['why_no_best_gamma']}")
    else:
        say(
            f"best gamma for the {best['aim']} over {content['workpiece_points']} points: {best['gamma_deg']:g} deg, "
            f"{content['quantity']} {best['value']:.4g}{unit.replace(',', '')}, reaches {best['points_reached']}"
        )
    for one in _others(content["trade_off"], best):
        more = "" if best is None else f" ({100.0 * (one['value'] / best['value'] - 1.0):+.0f} %)"
        but = "and" if best is not None and one["points_reached"] > best["points_reached"] else "but"
        say(
            f"gamma {one['gamma_deg']:g} deg gives {one['value']:.4g}{unit.replace(',', '')}{more}, {but} reaches "
            f"{one['points_reached']} of {content['workpiece_points']} points"
        )
    if not content["all_solutions_found"]:
        say("note: this arm has no closed-form inverse kinematics; the numerical search may miss postures")


def _others(front: Sequence[Mapping[str, Any]], best: Mapping[str, Any] | None) -> list[Mapping[str, Any]]:
    """Other angles of the trade-off: that which reaches most, and the next that reach less than the best one."""
    if best is None:
        return list(front[:3])
    wider = [one for one in front if one["points_reached"] > best["points_reached"]]
    return wider[:1] + [one for one in front if one["points_reached"] < best["points_reached"]][: 3 - len(wider[:1])]
