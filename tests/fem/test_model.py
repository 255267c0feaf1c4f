"""Building a model: what is refused, with which words, and what copies keep."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from refusals import refuses

from fem import ArmModel, ConstantSpring, LawSpring, build_model, deflection
from fem.springs import PolynomialBasis, spring_from
from robots import ModelDescription, load_description, load_robot
from robots.schema.springs import LogFourierLaw, TableLaw

DOWN = np.array([0, 0, -100.0, 0, 0, 0])


@pytest.fixture(scope="module")
def kuka() -> ArmModel:
    return build_model(load_description("kr60-3"))


def _compliances(model: ArmModel) -> list[float]:
    return [float(joint.axial.compliance(np.zeros((1, 6)))[0]) for joint in model.joints]


def test_unknown_kind_of_links() -> None:
    refuses("M003", r"links: got 'plate'; allowed: rigid, beam", build_model, load_description("kr60-3"), links="plate")


def test_a_serial_robot_has_no_parallelogram_path() -> None:
    refuses(
        "M003",
        r"load path of kr60-3.*serial: this robot has no parallelogram",
        build_model,
        load_description("kr60-3"),
        load_path="parallelogram",
    )


def test_unknown_load_path() -> None:
    refuses(
        "M003",
        r"load path: got 'hydraulic'; allowed: parallelogram, serial",
        build_model,
        load_description("xr701"),
        load_path="hydraulic",
    )


def test_the_description_names_the_load_path() -> None:
    assert build_model(load_description("xr701")).load_path == "parallelogram"
    assert build_model(load_description("xr701"), load_path="serial").bar is None
    assert build_model(load_description("kr60-3")).load_path == "serial"


def test_rigid_links_leave_only_the_joints() -> None:
    model = build_model(load_description("xr701"), links="rigid")
    assert model.links == ()
    assert model.bar is not None
    assert model.bar.compliance == 0.0
    assert model.bar.crank is None


def test_unknown_joint_in_springs(kuka: ArmModel) -> None:
    refuses(
        "M001", r"joint: got 'elbow'; allowed: j1, j2, j3, j4, j5, j6", kuka.with_springs, {"j1": 1e6, "elbow": 1e6}
    )


@pytest.mark.parametrize("stiffness", [0.0, -1e6, np.nan, 0])
def test_a_stiffness_must_be_positive(kuka: ArmModel, stiffness: float) -> None:
    refuses("M002", r"joint stiffness.*greater than 0", kuka.with_springs, {"j1": stiffness})


@pytest.mark.parametrize("number", [500_000, 5e5, np.float64(5e5), np.int64(500_000), np.float32(5e5)])
def test_any_kind_of_number_is_a_stiffness(kuka: ArmModel, number: float) -> None:
    assert _compliances(kuka.with_springs({"j2": number}))[1] == 1.0 / 5e5


def test_springs_come_from_the_description_and_copies_leave_the_original_alone(kuka: ArmModel) -> None:
    # Gao et al. 2024, table 1 in N mm/rad; one division apart.
    published = 1e3 / np.array([2.1977e9, 0.8994e9, 1.1118e9, 0.0644e9, 0.0254e9, 0.0200e9])
    np.testing.assert_allclose(_compliances(kuka), published, rtol=1e-14)
    other = kuka.with_springs({"j3": 1e5})
    np.testing.assert_allclose(_compliances(kuka), published, rtol=1e-14)
    assert _compliances(other)[2] == 1e-5
    assert _compliances(other)[:2] == _compliances(kuka)[:2]


def test_rigid_joints_do_not_give_way_in_any_direction(boom: Callable[..., ModelDescription]) -> None:
    springs = {"stiffness": 1e5, "tilt_stiffness": 1e6, "translational_stiffness": 1e8}
    model = build_model(boom(**springs), links="rigid")
    assert np.abs(deflection(model, np.zeros((1, 1)), DOWN)).max() > 0
    stiff = deflection(model.with_rigid_joints(), np.zeros((1, 1)), np.ones(6))
    np.testing.assert_array_equal(stiff, 0.0)


@pytest.mark.parametrize("name", ["j1", "bar", "crank"])
def test_a_link_must_not_share_its_name_with_another_part(boom: Callable[..., ModelDescription], name: str) -> None:
    description = boom()
    link = description.link[0].model_copy(update={"name": name})
    refuses(
        "M003",
        rf"link name of boom: got '{name}'.*rename",
        build_model,
        description.model_copy(update={"link": (link,)}),
    )


def test_log_polynomial_spring_by_hand() -> None:
    basis = PolynomialBasis(
        columns=(1, 2),
        centre=np.radians([5.0, 77.5]),
        half_range=np.radians([40.0, 37.5]),
        exponents=np.array([[0, 0], [1, 0], [1, 2]]),
    )
    spring = LawSpring(basis, np.array([13.5, 0.3, -0.2]))
    q = np.zeros((2, 6))
    q[:, 1], q[:, 2] = np.radians([5.0, 25.0]), np.radians([115.0, 40.0])
    # u = (0, 1) and (0.5, -1).
    expected = np.exp([-13.5, -(13.5 + 0.3 * 0.5 - 0.2 * 0.5)])
    np.testing.assert_allclose(spring.compliance(q), expected, rtol=1e-13)  # exp amplifies 13.5 eps


def test_a_constant_spring_is_the_same_everywhere() -> None:
    q = np.random.default_rng(0).normal(size=(5, 6))
    np.testing.assert_array_equal(ConstantSpring(4e5).compliance(q), np.full(5, 2.5e-6))
    np.testing.assert_array_equal(ConstantSpring(np.inf).compliance(q), 0.0)


def test_fourier_and_table_laws_from_a_file_by_hand() -> None:
    robot = load_robot("xr701")
    fourier = spring_from(
        robot, LogFourierLaw(kind="log-fourier", input="q2_deg", coefficients=(13.0, 0.2, -0.1), source="assumed")
    )
    q = np.zeros((3, 6))
    q[:, 1] = [-0.5, 0.1, 0.7]
    expected = np.exp(-(13.0 + 0.2 * np.cos(q[:, 1]) - 0.1 * np.sin(q[:, 1])))
    np.testing.assert_allclose(fourier.compliance(q), expected, rtol=1e-13)
    table = spring_from(
        robot,
        TableLaw(
            kind="table", input="q2_deg", nodes_deg=(0.0, 20.0), stiffness_Nm_per_rad=(1e5, 4e5), source="assumed"
        ),
    )
    q[:, 1] = np.radians([-30.0, 10.0, 40.0])
    # Half-way in the logarithm is the geometric mean; beyond the ends it stays.
    np.testing.assert_allclose(1.0 / table.compliance(q), [1e5, 2e5, 4e5], rtol=1e-12)
