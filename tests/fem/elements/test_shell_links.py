from __future__ import annotations

import numpy as np
import pytest
from refusals import refuses

import fem
from fem.reference import direct
from robots import load_description


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "path"), [("kr60-3", "serial"), ("tx200", "serial"), ("xr701", "parallelogram"), ("xr701", "serial")]
)
def test_fast_path_equals_direct_stiffness_with_shell_links(name: str, path: str, rng: np.random.Generator) -> None:
    model = fem.build_model(load_description(name), "shell", path)  # type: ignore[arg-type]
    model = model.with_springs(dict(zip(model.robot.joint_names, rng.uniform(3e5, 3e6, 6), strict=True)))
    limits = model.robot.limits
    q = rng.uniform(limits[:, 0], limits[:, 1], (400, 6))
    q = q[model.robot.reachable(q)][:20]
    assert len(q) == 20
    C, D = fem.compliance(model, q), direct.compliance(model, q)
    scale = np.sqrt(np.einsum("nii->ni", C))
    # eps times the condition of the direct system, as for beams (tests/fem/reference/test_fast_against_direct.py).
    assert (np.abs(C - D) / (scale[:, :, None] * scale[:, None])).max() < 2e-9


def test_shell_and_beam_links_of_the_xr701_agree_within_ten_percent() -> None:
    description = load_description("xr701")
    q = np.radians([[0, -35, 40, 0, 0, 0], [0, 5, 77.5, 0, 0, 0], [0, 45, 115, 0, 0, 0]])
    load = np.array([0.0, 0.0, -650.0, 0.0, 0.0, 0.0])
    d = {kind: fem.deflection(fem.build_model(description, kind), q, load)[:, 2] for kind in ("beam", "shell")}  # type: ignore[arg-type]
    # 10 %: short fat casings with rigid rings are stiffer than beams; measured 1 to 3 % here.
    np.testing.assert_allclose(d["shell"], d["beam"], rtol=0.10)


def test_full_assembly_of_shell_links_is_refused_by_the_dense_reference() -> None:
    model = fem.build_model(load_description("kr60-3"), "shell")
    refuses("B003", "shell", direct.compliance, model, np.zeros((1, 6)), condensed=False)
