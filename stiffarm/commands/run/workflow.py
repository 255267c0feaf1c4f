"""``stiffarm run``: the whole chain from measured deflections to report, surrogate and maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from doe import Measurements, PoseEffects, bundled_campaign, select_loads, sensitivity_study
from doe.estimation.campaign import Campaign
from doe.tables.loaded import select_poses
from fem import ArmModel, directional_stiffness
from fem.arm import Arm
from robots import InputError, save_description
from robots.arrays import Array
from robots.quantities import length, rounded
from stiffarm.commands.calibrate import payload as calibration_payload
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.fit import learning
from stiffarm.commands.fit.report import payload as trained_payload
from stiffarm.commands.maps.command import mapped
from stiffarm.commands.maps.joints import JointsRequest
from stiffarm.commands.query.command import errors_words
from stiffarm.commands.rehearse.step import Rehearsed
from stiffarm.commands.run import held_out, link_models, missing, payload, proof
from stiffarm.commands.run.findings import Findings, Recommended, slug
from stiffarm.commands.run.missing import Look
from stiffarm.commands.run.usual import usual_campaign, usual_factorial
from stiffarm.commands.sensitivity import factorial
from stiffarm.request import readings_asked
from stiffarm.result import Result, Table
from stiffarm.session import inputs, readings, steps
from stiffarm.session.console import say, say_notes
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.stated import at_load
from stiffarm.session.steps import FactorialRuns
from stiffarm.session.workspace import WorkspaceStiffness, workspace_stiffness
from surrogate import Surrogate, Trained, full_poses, save_surrogate
from surrogate.model import predict_compliance

if TYPE_CHECKING:
    from stiffarm.commands.run.command import RunRequest


def run_all(given: Arm, asked: RunRequest, folder: OutputFolder) -> Result:
    """Run every step and write models, surrogates, maps, pictures and the report into the folder."""
    table = readings_asked(given, asked.data, confirm_units=asked.confirm_units)
    say_notes(table.notes)
    remedy = "run its steps by themselves (`stiffarm diagnose`, `calibrate`, `fit`, `map`)"
    inputs.refuse_effects(given, "the whole chain", remedy)
    scheme = _scheme(given, table, asked.scheme_file)
    # What it asks for and was not measured is refused before the work.
    select_poses(select_loads(table, scheme.loads_N), scheme.beside.sensitivity.poses, "sensitivities")
    kept = None
    if asked.holdout is not None:
        kept = readings_asked(given, asked.holdout, confirm_units=asked.confirm_units)
        say_notes([f"{kept.source}: {note}" for note in kept.notes])
    with folder.timed("diagnosis"):
        looks = missing.looks(given, table, scheme, kept, asked.seed, folder, say)
    with folder.timed("calibration"):
        findings = _calibrated(given, table, scheme, kept, looks, asked.seed)
    if findings.rigid_warning:
        say_notes([findings.rigid_warning])
    with folder.timed("surrogates"):
        findings = _learned(findings, folder)
    with folder.timed("map"):
        arm = replace(given, description=findings.best.description, model=findings.best.model)
        drawn = mapped(arm, JointsRequest(points=asked.points, html=True, seed=asked.seed), table=False)
        map_facts, map_pictures = drawn.write_files(folder)
    stiffness = workspace_stiffness(arm.description, arm.model)
    say_notes(drawn.remarks)
    told = None
    if asked.rehearse:
        with folder.timed("rehearsal"):
            say("rehearsal: an effect is hidden in simulated readings of this arm")
            told = proof.rehearse(findings, table, folder, say)
    from stiffarm.commands.run.story.story import write_report

    for variant in findings.variants:
        save_description(variant.description, folder.path(f"models/{slug(variant.name)}.toml"))
    save_description(findings.best.description, folder.path("model.toml"))
    save_surrogate(findings.surrogate, folder.path("surrogate.json"))
    with folder.timed("report"):
        say("report")
        lede, answer = write_report(findings, map_facts, map_pictures, told, stiffness, folder)
    result = Result(
        name="run",
        title=findings.title,
        question="which model, and how stiff is the arm?",
        answer=lede,
        how_sure=answer.sure,
        what_next=answer.todo,
        facts=_facts(findings, map_facts, told, stiffness),
        tables=(_models(findings),),
        arm=replace(given, description=findings.best.description, model=findings.best.model),
        found=findings,
    )
    folder.write_json("results.json", result.as_json)
    return result


def _scheme(given: Arm, table: Measurements, file: Path | None) -> Campaign:
    """The scheme given, the robot's published one where its poses were measured, else springs all at once.

    Raises
    ------
    InputError
        A scheme file without stages.
    """
    scheme = bundled_campaign(given.robot.name) if file is None else readings.read_scheme(given.robot, file)
    if scheme is None:
        return usual_campaign(given, table)
    if not scheme.stage:
        remedy = "give it to `stiffarm calibrate --campaign`, or leave it out: springs are then calibrated all at once"
        raise InputError(
            "--scheme-file", code="A009", value=scheme.title, allowed="a scheme with stages", remedy=remedy
        )
    staged = {pose for stage in scheme.stage for pose in stage.poses}
    if file is None and not staged <= set(table.pose):
        say("note: the published scheme asks for other poses than were read; all springs are calibrated at once")
        return usual_campaign(given, table)
    if scheme.compare is not None:
        return scheme
    return scheme.model_copy(update={"compare": usual_campaign(given, table).compare})


def _calibrated(
    given: Arm,
    table: Measurements,
    scheme: Campaign,
    kept: Measurements | None,
    looks: tuple[Look, ...],
    seed: int,
) -> Findings:
    """Every load path and scheme, the same with other links beside it, and which model to take."""
    used, straight = select_loads(table, scheme.loads_N), scheme.beside.sensitivity.poses
    models = link_models.by_load_path(given)
    varied, at = scheme.beside.sensitivity.joints, select_poses(used, straight, "sensitivities")
    effects: dict[str, list[PoseEffects]] = {
        path: sensitivity_study(one.model, at, varied, *scheme.springs.ends) for path, one in models.items()
    }
    own = link_models.calibrate(models, table, scheme, _say_variant, kept)
    rigid, compared = None, None
    if given.description.link:
        beside = inputs.with_links(given, link_models.BESIDE[given.model.link_kind])
        # Without flexible links there is no first model: beams stand in for them.
        rigid = steps.rigid_joints(beside if given.model.link_kind == "rigid" else given, used, straight)
        say(
            f"with rigid joints, measured deflection is {np.median(rigid.factor):.0f} times the simulated one "
            f"({rigid.links} links, median of poses {', '.join(straight)})"
        )
        say(f"repeating the calibrations with {beside.model.link_kind} links, for comparison")
        other = link_models.calibrate(link_models.by_load_path(beside), table, scheme, _say_variant)
        compared = link_models.LinkModels(own, other)
    best = recommended(own.variants, looks, used)
    for line in held_out.sentences(held_out.of_variants(own.variants), best.beside_variants_mm):
        say(line)
    say(f"recommended: {best.name} (smallest error at poses that it has not seen)")
    published = own.variants[0] if scheme.stage else None
    found = Findings(given, table, scheme, looks, rigid, effects, own, compared, best, published, used, seed)
    for doubt in found.constant.doubts:
        say(f"warning: {doubt.words}")
    return found


def recommended(variants: Sequence[Calibrated], looks: Sequence[Look], used: Measurements) -> Recommended:
    """What predicts poses best that it has not seen (not what fits best).

    A diagnosed model competes where it was fitted to the same readings and something was found.
    """
    found = [
        Recommended(v.name, v.description, v.model, v.found.rms_mm, v.left_out_rms_mm, len(v.found.overall), v)
        for v in variants
    ]
    for look in looks:
        d = look.found
        if d.in_model and d.used.n == used.n:
            arm, after = at_load(look.written.arm), d.found.after
            errors_mm = after.fit_rms_mm, d.left_out_rms_mm[1]
            held_mm = None if d.held_out is None else d.held_out.rms_after_mm
            count = len(after.setting.data)
            found.append(
                Recommended("diagnosed", arm.description, arm.model, *errors_mm, count, held_out_rms_mm=held_mm)
            )
    return min(found, key=lambda one: one.left_out_rms_mm if np.isfinite(one.left_out_rms_mm) else np.inf)


def _say_variant(variant: Calibrated) -> None:
    say(
        f"{variant.name}: {variant.found.count}, RMS {variant.found.rms_mm:.3f} mm, "
        f"left-out poses {variant.left_out_rms_mm:.3f} mm"
    )


def _learned(f: Findings, folder: OutputFolder) -> Findings:
    """With surrogates and factorial runs of the recommended model and of the published scheme's."""
    factorial: dict[str, FactorialRuns] = {}
    trained: dict[str, Trained] = {}
    models = {f.best.name: (f.best.description, f.best.model)}
    if f.published is not None:
        models[f.published.name] = f.published.description, f.published.model
    degree = max((law.degree for law in f.scheme.regressions), default=6)
    asked = f.scheme.beside.factorial
    # What was missing may make another angle matter: a tool that is softer one way than the other.
    plan = asked or usual_factorial(f.given, f.data, [model for _, model in models.values()])
    for name, (description, model) in models.items():
        factorial[name] = steps.factorial_runs(model, plan, whole=asked is not None)
        trained[name] = learning.learn(description, model, plan.inputs, f.seed, name, degree=degree)
        for one in trained[name].surrogates:
            save_surrogate(one, folder.path(f"surrogates/{slug(name)}_{one.basis}.json"))
        say(f"surrogate of {name}: {errors_words(trained[name].best)}")
        say_notes(learning.remarks_of(trained[name]))
    check = _measured_pose_check(trained[f.best.name].best, f.best.model, f.used)
    return replace(f, factorial=factorial, trained=trained, pose_check=check)


def _models(findings: Findings) -> Table:
    """The models that were calibrated, and the diagnosed one where it is recommended."""
    errors = {v.name: (v.found.rms_mm, v.left_out_rms_mm) for v in findings.variants}
    errors[findings.best.name] = findings.best.rms_mm, findings.best.left_out_rms_mm
    fitted, unseen = 1e-3 * np.array(list(errors.values())).T
    return Table(
        "models",
        "Models, by their error at poses that they have not seen",
        {"model": list(errors), "recommended": [name == findings.best.name for name in errors]},
        {
            length("fit_error", "RMS error of the fit"): fitted,
            length("left_out_error", "RMS error at poses left out"): unseen,
        },
    )


def _facts(
    findings: Findings, drawn: dict[str, Any], told: Rehearsed | InputError | None, stiffness: WorkspaceStiffness
) -> dict[str, Any]:
    """What each step says in JSON."""
    labels, learned, exact = findings.pose_check
    content = {
        "robot": findings.given.robot.name,
        "links": findings.given.model.link_kind,
        "diagnoses": missing.payload(findings.looks),
        "rigid_joints": None if findings.rigid is None else payload.rigid(findings.rigid),
        "sensitivity": {path: factorial.payload(e) for path, e in findings.effects.items()},
        "variants": {v.name: calibration_payload.calibration(v) for v in findings.variants},
        "recommended": findings.best.name,
        "warning": findings.rigid_warning or None,
        "link_models": None if findings.link_models is None else payload.link_models(findings.link_models),
        "factorial": {name: payload.factorial(runs) for name, runs in findings.factorial.items()},
        "surrogates": {name: trained_payload(t) for name, t in findings.trained.items()},
        "measured_poses": [
            {
                "pose": label,
                "surrogate_N_per_mm": rounded(a),
                "model_N_per_mm": rounded(b),
                "relative_difference": rounded(a / b - 1.0),
            }
            for label, a, b in zip(labels, learned, exact, strict=True)
        ],
        "map": drawn,
        "stiffness_at_the_tool": stiffness.payload(findings.given.robot.coordinates),
        "rehearsal": proof.payload(told),
    }
    if findings.held_out:
        content["holdout"] = held_out.payload(findings.held_out)
    return content


def _measured_pose_check(learned: Surrogate, model: ArmModel, data: Measurements) -> tuple[list[str], Array, Array]:
    """Surrogate and model stiffness (n,) N/mm at the distinct measured poses, with their labels."""
    rows = [rows[0] for rows in data.pose_groups().values()]
    q = data.q[rows]
    columns = [model.robot.coordinate_index(name) for name in learned.inputs]
    return (
        [data.pose[i] for i in rows],
        1e-3 / predict_compliance(learned, q[:, columns]),
        directional_stiffness(model, full_poses(model.robot, learned, q[:, columns])) * 1e-3,
    )
