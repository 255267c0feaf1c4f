"""``stiffarm run``: the whole chain from measured deflections to report, surrogate and maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doe import Measurements, PoseEffects, Scheme, select_loads
from fem import deflection_by_part
from robots import LoadPath, content_hash, save_description
from stiffarm import inputs, maps, payloads, steps
from stiffarm.console import progress, say
from stiffarm.inputs import ModelInput
from stiffarm.outputs import OutputFolder
from stiffarm.steps import FactorialRuns, RigidJoints, Variant
from surrogate import Surrogate, Trained, save_surrogate

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Findings:
    """Everything the report tells, computed once."""

    given: ModelInput
    data: Measurements
    scheme: Scheme
    rigid: RigidJoints
    effects: Mapping[str, list[PoseEffects]]
    variants: tuple[Variant, ...]
    best: Variant
    published: Variant
    factorial: Mapping[str, FactorialRuns]
    trained: Mapping[str, Trained]
    budget_mm: Mapping[str, Array]
    budget_poses: tuple[str, ...]
    pose_check: tuple[list[str], Array, Array]
    seed: int

    @property
    def surrogate(self) -> Surrogate:
        """The surrogate of the recommended variant."""
        return self.trained[self.best.name].best


def run_all(
    model: str,
    data: Path | None,
    scheme_file: Path | None,
    links: str | None,
    out: Path,
    points: int,
    seed: int,
    command: list[str],
) -> dict[str, Any]:
    """Run every step and write models, surrogates, maps, pictures and the report into ``out``."""
    given = inputs.read_model(model, links, None)
    table = inputs.read_data(given.robot, model, data)
    scheme = inputs.read_scheme(given.robot, scheme_file)
    files: dict[str, Path | str] = {"model": content_hash(given.description), "data": table.sha256}
    if scheme_file is not None:
        files["scheme"] = scheme_file
    with OutputFolder(out, command, files, seed) as folder:
        with folder.timed("calibration"):
            rigid, effects, variants = _calibrations(given, table, scheme)
        findings = _learned(given, table, scheme, rigid, effects, variants, seed, folder)
        with folder.timed("map"), progress("stiffness map") as bar:
            made = steps.stiffness_map(
                findings.best.description, findings.best.model, points, findings.surrogate, progress=bar
            )
            drawn = maps.write(made, findings.best.description, given.robot, folder)
        for message in drawn["messages"]:
            say(f"note: {message}")
        content = _write_results(findings, drawn, folder)
        with folder.timed("report"):
            from stiffarm.story import write_report

            say("report")
            write_report(findings, drawn, folder)
    say(f"done: open {out / 'report.html'}")
    return content


def _calibrations(
    given: ModelInput, table: Measurements, scheme: Scheme
) -> tuple[RigidJoints, dict[str, list[PoseEffects]], tuple[Variant, ...]]:
    for note in table.notes:
        say(f"note: {note}")
    used = select_loads(table, scheme.loads_N)
    straight = scheme.sensitivity.poses
    rigid = steps.rigid_joints(given, used, straight)
    say(
        f"rigid joints: measured deflection is {np.median(rigid.factor):.0f} times the simulated one "
        f"(median of poses {', '.join(straight)})"
    )
    effects: dict[str, list[PoseEffects]] = {}
    variants: list[Variant] = []
    for path in _load_paths(given):
        one = inputs.with_load_path(given, path)
        effects[path] = steps.sensitivity(
            one, used, scheme.sensitivity.joints, straight, scheme.low_Nm_per_rad, scheme.high_Nm_per_rad
        )
        staged = steps.calibrate_by_stages(one, table, scheme, scheme.loads_N)
        bounds = (scheme.low_Nm_per_rad, scheme.high_Nm_per_rad)
        constant = steps.calibrate_constant(one, table, scheme.constant.joints, scheme.loads_N, bounds, scheme.gauge_mm)
        for variant in (staged, constant):
            say(
                f"{variant.name}: {variant.parameters} parameters, RMS {variant.rms_mm:.3f} mm, "
                f"left-out poses {variant.left_out.rms_mm:.3f} mm"
            )
        variants += [staged, constant]
    return rigid, effects, tuple(variants)


def _load_paths(given: ModelInput) -> tuple[LoadPath, ...]:
    """The model's own load path first, then the other one if the robot has it."""
    if given.robot.parallelogram is None:
        return ("serial",)
    own = given.model.load_path
    return (own, "serial" if own == "parallelogram" else "parallelogram")


def _learned(
    given: ModelInput,
    table: Measurements,
    scheme: Scheme,
    rigid: RigidJoints,
    effects: dict[str, list[PoseEffects]],
    variants: tuple[Variant, ...],
    seed: int,
    folder: OutputFolder,
) -> Findings:
    best = steps.recommended(list(variants))
    published = variants[0]
    say(f"recommended: {best.name} (smallest error on left-out poses)")
    factorial: dict[str, FactorialRuns] = {}
    trained: dict[str, Trained] = {}
    with folder.timed("surrogates"):
        for variant in {v.name: v for v in (best, published)}.values():
            factorial[variant.name] = steps.factorial_runs(variant.model, scheme)
            with progress(f"surrogate of {variant.name}") as bar:
                trained[variant.name] = steps.learn(
                    variant.description,
                    variant.model,
                    scheme.factorial.inputs,
                    seed,
                    degree=scheme.regression_degree,
                    progress=bar,
                )
            error = trained[variant.name].best.errors
            say(
                f"surrogate of {variant.name}: {error.basis}, held-out relative error {error.rms_relative:.1e} RMS, "
                f"{error.max_relative:.1e} worst"
            )
    used = select_loads(table, scheme.loads_N)
    parts = deflection_by_part(best.model, used.q, used.wrench)
    return Findings(
        given=given,
        data=table,
        scheme=scheme,
        rigid=rigid,
        effects=effects,
        variants=variants,
        best=best,
        published=published,
        factorial=factorial,
        trained=trained,
        budget_mm={name: d[:, 2] * 1e3 for name, d in parts.items()},
        budget_poses=used.pose,
        pose_check=steps.nine_pose_check(trained[best.name].best, best.model, used),
        seed=seed,
    )


def _write_results(findings: Findings, drawn: dict[str, Any], folder: OutputFolder) -> dict[str, Any]:
    """Model TOMLs, surrogates, factorial table and results.json."""
    for variant in findings.variants:
        save_description(variant.description, folder.path(f"models/{slug(variant.name)}.toml"))
    save_description(findings.best.description, folder.path("model.toml"))
    for name, trained in findings.trained.items():
        for one in trained.surrogates:
            save_surrogate(one, folder.path(f"surrogates/{slug(name)}_{one.basis.name}.json"))
    save_surrogate(findings.surrogate, folder.path("surrogate.json"))
    labels, learned, exact = findings.pose_check
    content = {
        "robot": findings.given.robot.name,
        "links": findings.given.model.link_kind,
        "rigid_joints": payloads.rigid(findings.rigid),
        "sensitivity": {path: payloads.effects(e) for path, e in findings.effects.items()},
        "variants": {v.name: payloads.variant(v) for v in findings.variants},
        "recommended": findings.best.name,
        "factorial": {name: payloads.factorial(runs) for name, runs in findings.factorial.items()},
        "surrogates": {name: payloads.trained(t) for name, t in findings.trained.items()},
        "measured_poses": [
            {
                "pose": label,
                "surrogate_N_per_mm": payloads.number(a),
                "model_N_per_mm": payloads.number(b),
                "relative_difference": payloads.number(a / b - 1.0),
            }
            for label, a, b in zip(labels, learned, exact, strict=True)
        ],
        "map": drawn,
    }
    folder.write_json("results.json", content)
    return content


def slug(name: str) -> str:
    """``constant, serial`` -> ``constant_serial``."""
    return "_".join(name.replace(",", " ").split())
