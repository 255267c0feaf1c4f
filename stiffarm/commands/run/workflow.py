"""``stiffarm run``: the whole chain from measured deflections to report, surrogate and maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from doe import Measurements, PoseEffects, select_loads, sensitivity_study
from doe.estimation.campaign import Campaign
from doe.tables.loaded import select_poses
from fem import ArmModel, directional_stiffness
from fem.arm import Arm
from robots import save_description
from robots.arrays import Array
from stiffarm.commands.calibrate import payload as calibration_payload
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.fit import learning
from stiffarm.commands.fit.results import payload as trained_payload
from stiffarm.commands.maps import sweep
from stiffarm.commands.run import held_out, link_models, payload
from stiffarm.commands.run.findings import Findings, slug
from stiffarm.commands.run.link_models import LinkModels
from stiffarm.commands.sensitivity import factorial
from stiffarm.session import inputs, readings, steps
from stiffarm.session.console import progress, say
from stiffarm.session.frame import Frame
from stiffarm.session.json_text import number
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.steps import FactorialRuns, RigidJoints
from surrogate import Surrogate, Trained, full_poses, save_surrogate
from surrogate.model import predict_compliance


def run_all(
    frame: Frame,
    model: str,
    data: Path | None,
    scheme_file: Path | None,
    links: str | None,
    points: int,
    seed: int,
    holdout: Path | None = None,
    *,
    confirm_units: bool = False,
) -> dict[str, Any]:
    """Run every step and write models, surrogates, maps, pictures and the report into the frame's folder.

    ``holdout``: table of poses that no calibration sees, to judge the variants by;
    ``confirm_units``: tables are right though they look like other units.
    """
    given = frame.model(model, links)
    table = frame.readings(given, data, confirm_units=confirm_units)
    remedy = "run its steps by themselves (`stiffarm calibrate --scheme global`, `fit`, `map`)"
    inputs.refuse_effects(given, "the whole chain", remedy)
    frame.reads(scheme_file=scheme_file)
    scheme = readings.read_scheme(given.robot, scheme_file)
    kept = frame.held_out(given, holdout, confirm_units=confirm_units)
    with frame.folder(seed) as folder:
        with folder.timed("calibration"):
            rigid, effects, compared = _calibrations(given, table, scheme, kept)
        findings = _learned(given, table, scheme, rigid, effects, compared, seed, folder)
        with folder.timed("map"), progress("stiffness map") as bar:
            arm = replace(given, description=findings.best.description, model=findings.best.model)
            drawn = sweep.write(sweep.learned_map(arm, findings.surrogate, points, progress=bar), arm, folder)
        for message in drawn["messages"]:
            say(f"note: {message}")
        from stiffarm.commands.run.story.story import write_report

        content = _write_results(findings, drawn, folder)
        with folder.timed("report"):
            say("report")
            write_report(findings, drawn, folder)
    return content


def _calibrations(
    given: Arm, table: Measurements, scheme: Campaign, kept: Measurements | None
) -> tuple[RigidJoints, dict[str, list[PoseEffects]], LinkModels]:
    used = select_loads(table, scheme.loads_N)
    straight = scheme.beside.sensitivity.poses
    beside = inputs.with_links(given, link_models.BESIDE[given.model.link_kind])
    # Without flexible links there is no first model: beams stand in for them.
    rigid = steps.rigid_joints(beside if given.model.link_kind == "rigid" else given, used, straight)
    say(
        f"rigid joints: measured deflection is {np.median(rigid.factor):.0f} times the simulated one "
        f"({rigid.links} links, median of poses {', '.join(straight)})"
    )
    models = link_models.by_load_path(given)
    varied, at = scheme.beside.sensitivity.joints, select_poses(used, straight, "sensitivities")
    effects: dict[str, list[PoseEffects]] = {
        path: sensitivity_study(one.model, at, varied, *scheme.springs.ends) for path, one in models.items()
    }
    own = link_models.calibrate(models, table, scheme, _say_variant, kept)
    for line in held_out.sentences(held_out.of_variants(own.variants)):
        say(line)
    say(f"the same with {beside.model.link_kind} links, to compare")
    other = link_models.calibrate(link_models.by_load_path(beside), table, scheme, _say_variant)
    return rigid, effects, LinkModels(own, other)


def recommended(variants: Sequence[Calibrated]) -> Calibrated:
    """The calibration that predicts left-out poses best (not the one that fits best)."""
    return min(variants, key=lambda v: v.left_out_rms_mm if np.isfinite(v.left_out_rms_mm) else np.inf)


def _say_variant(variant: Calibrated) -> None:
    say(
        f"{variant.name}: {variant.found.count}, RMS {variant.found.rms_mm:.3f} mm, "
        f"left-out poses {variant.left_out_rms_mm:.3f} mm"
    )


def _learned(
    given: Arm,
    table: Measurements,
    scheme: Campaign,
    rigid: RigidJoints,
    effects: dict[str, list[PoseEffects]],
    compared: LinkModels,
    seed: int,
    folder: OutputFolder,
) -> Findings:
    variants = compared.own.variants
    best = recommended(variants)
    published = variants[0]
    say(f"recommended: {best.name} (smallest error on left-out poses)")
    factorial: dict[str, FactorialRuns] = {}
    trained: dict[str, Trained] = {}
    with folder.timed("surrogates"):
        for variant in {v.name: v for v in (best, published)}.values():
            factorial[variant.name] = steps.factorial_runs(variant.model, scheme.beside.factorial)
            trained[variant.name] = learning.learn(
                variant.description,
                variant.model,
                scheme.beside.factorial.inputs,
                seed,
                folder,
                f"surrogates/{slug(variant.name)}",
                variant.name,
                degree=max((law.degree for law in scheme.regressions), default=6),
            )
    used = select_loads(table, scheme.loads_N)
    return Findings(
        given=given,
        data=table,
        scheme=scheme,
        rigid=rigid,
        effects=effects,
        link_models=compared,
        best=best,
        published=published,
        factorial=factorial,
        trained=trained,
        used=used,
        pose_check=_nine_pose_check(trained[best.name].best, best.model, used),
        seed=seed,
    )


def _write_results(findings: Findings, drawn: dict[str, Any], folder: OutputFolder) -> dict[str, Any]:
    """Model TOMLs, surrogates, factorial table and results.json."""
    for variant in findings.variants:
        save_description(variant.description, folder.path(f"models/{slug(variant.name)}.toml"))
    save_description(findings.best.description, folder.path("model.toml"))
    save_surrogate(findings.surrogate, folder.path("surrogate.json"))
    labels, learned, exact = findings.pose_check
    content = {
        "robot": findings.given.robot.name,
        "links": findings.given.model.link_kind,
        "rigid_joints": payload.rigid(findings.rigid),
        "sensitivity": {path: factorial.payload(e) for path, e in findings.effects.items()},
        "variants": {v.name: calibration_payload.calibration(v) for v in findings.variants},
        "recommended": findings.best.name,
        "link_models": payload.link_models(findings.link_models),
        "factorial": {name: payload.factorial(runs) for name, runs in findings.factorial.items()},
        "surrogates": {name: trained_payload(t) for name, t in findings.trained.items()},
        "measured_poses": [
            {
                "pose": label,
                "surrogate_N_per_mm": number(a),
                "model_N_per_mm": number(b),
                "relative_difference": number(a / b - 1.0),
            }
            for label, a, b in zip(labels, learned, exact, strict=True)
        ],
        "map": drawn,
    }
    if findings.held_out:
        content["holdout"] = held_out.payload(findings.held_out)
    folder.write_json("results.json", content)
    return content


def _nine_pose_check(learned: Surrogate, model: ArmModel, data: Measurements) -> tuple[list[str], Array, Array]:
    """Surrogate and model stiffness (n,) N/mm at the distinct measured poses, with their labels."""
    rows = [rows[0] for rows in data.pose_groups().values()]
    q = data.q[rows]
    columns = [model.robot.coordinate_index(name) for name in learned.inputs]
    return (
        [data.pose[i] for i in rows],
        1e-3 / predict_compliance(learned, q[:, columns]),
        directional_stiffness(model, full_poses(model.robot, learned, q[:, columns])) * 1e-3,
    )
