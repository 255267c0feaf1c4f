"""Robot files: the bundled ones hold what their sources say, the bad ones are refused in plain words."""

from __future__ import annotations

import copy
import os
import re
import tomllib
from collections.abc import Callable, Iterator
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit
from refusals import refuses

from robots import (
    InputError,
    InputErrors,
    bundled_names,
    content_hash,
    load_description,
    load_robot,
    save_description,
)
from robots.library.models import parse_description, to_toml
from robots.robot import robot_from
from robots.schema.description import BUILT_IN_SOURCES
from robots.schema.quantities import RotationalStiffness

Data = dict[str, Any]


def raw(name: str) -> Data:
    return tomllib.loads(resources.files("robots").joinpath("data", f"{name}.toml").read_text(encoding="utf-8"))


def figures(node: Any, place: str = "") -> Iterator[tuple[str, Data]]:
    """Every table of the raw file that holds a value, with its place."""
    if isinstance(node, dict):
        if "value" in node:
            yield place, node
        for key, child in node.items():
            yield from figures(child, f"{place}.{key}")
    elif isinstance(node, list):
        for i, child in enumerate(node):
            yield from figures(child, f"{place}.{i}")


def refused(data: Data, name: str = "bad.toml") -> InputError:
    with pytest.raises(InputError) as caught:
        robot_from(parse_description(tomlkit.dumps(data), name))
    return caught.value


# --- bundled files


def test_four_robots_are_bundled() -> None:
    assert bundled_names() == ("fanuc-r2000ic", "kr60-3", "tx200", "xr701")


@pytest.mark.parametrize("name", bundled_names())
def test_bundled_files_round_trip_through_toml(name: str) -> None:
    description = load_description(name)
    assert description.name == name
    again = parse_description(to_toml(description), "round trip")
    assert again == description
    assert content_hash(again) == content_hash(description)


@pytest.mark.parametrize("name", bundled_names())
def test_each_figure_has_a_unit_and_a_known_source(name: str) -> None:
    data = raw(name)
    found = list(figures(data))
    # Six joints with limits and placement at least: an empty walk would prove nothing.
    assert len(found) > 30
    for place, figure in found:
        assert figure["unit"], place
        assert figure["source"] in {*data["sources"], *BUILT_IN_SOURCES}, place
    used = {figure["source"] for _, figure in found}
    assert set(data["sources"]) <= used, "a source that no figure refers to"


@pytest.mark.parametrize("name", bundled_names())
def test_no_number_stands_outside_a_figure(name: str) -> None:
    # Directions, signs and factors are definitions without a unit.
    definitions = {"axis", "beam_up", "sign", "factor"}

    def bare(node: Any, key: str) -> list[str]:
        if isinstance(node, dict):
            # An opening is one figure: shares have no unit, and its source is its own.
            return (
                []
                if "value" in node or {"side", "source"} <= node.keys()
                else [b for k, child in node.items() for b in bare(child, k)]
            )
        if isinstance(node, list) and key not in definitions:
            return [b for child in node for b in bare(child, key)]
        return [key] if isinstance(node, int | float) and key not in definitions else []

    assert bare(raw(name), "") == []


def test_xr701_says_that_its_geometry_is_not_measured() -> None:
    for place, figure in figures(raw("xr701")):
        if ".xyz" in place or ".section" in place or ".pin" in place:
            assert figure["source"] in {"class", "assumed", "definition"}, place


# a, d (mm), limits (deg): the papers' and data sheets' figures, typed here a second time.
KR60 = {
    "a": [0, 350, 850, 145, 0, 0],
    "d": [815, 0, 0, 820, 0, 0],
    "limits": [(-185, 185), (-135, 35), (-120 - 90, 158 - 90), (-350, 350), (-119, 119), (-350, 350)],
    "flange": 170,
}
TX200 = {
    "a": [0, 250, 950, 0, 0, 0],
    "d": [642, 0, 0, 800, 0, 0],
    "limits": [(-180, 180), (-120, 120), (-140, 145), (-270, 270), (-120, 120), (-270, 270)],
    "flange": 194,
}


@pytest.mark.parametrize(("name", "published"), [("kr60-3", KR60), ("tx200", TX200)])
def test_published_geometry_and_limits(name: str, published: Data) -> None:
    description = load_description(name)
    rows = [joint.dh for joint in description.joint]
    assert [row.a.value for row in rows if row is not None] == published["a"]
    assert [row.d.value for row in rows if row is not None] == published["d"]
    assert {row.a.unit for row in rows if row is not None} == {"mm"}
    assert [joint.limits.value for joint in description.joint] == published["limits"]
    assert description.flange.xyz.value == (0, 0, published["flange"])


def test_kr60_stiffness_is_the_papers_in_si() -> None:
    springs = [joint.stiffness for joint in load_description("kr60-3").joint]
    published = [2.1977e6, 0.8994e6, 1.1118e6, 0.0644e6, 0.0254e6, 0.0200e6]
    # One multiplication by 1e-3: round-off only.
    in_si = [spring.si for spring in springs if isinstance(spring, RotationalStiffness)]
    assert in_si == pytest.approx(published, rel=1e-14)


def test_arrays_are_in_si() -> None:
    robot = load_robot("xr701")
    # One multiplication each: round-off only.
    np.testing.assert_allclose(robot.limits[2], [40 * np.pi / 180, 115 * np.pi / 180], rtol=1e-15)
    assert robot.sign.tolist() == [1, 1, -1, 1, 1, 1]
    assert robot.offset[2] == pytest.approx(np.pi, rel=1e-15)
    assert robot.parallelogram is not None
    assert (robot.parallelogram.driven, robot.parallelogram.crank_about) == (2, 1)
    pin = raw("xr701")["parallelogram"]["pin"]
    assert pin["unit"] == "m"
    assert robot.parallelogram.pin.tolist() == pin["value"]


def test_the_hash_follows_content_not_layout() -> None:
    data = raw("tx200")
    text = tomlkit.dumps(data)
    same = parse_description("# a comment\n\n" + text, "same")
    assert content_hash(same) == content_hash(load_description("tx200"))
    data["payload"]["value"] += 1
    other = parse_description(tomlkit.dumps(data), "other")
    assert content_hash(other) != content_hash(same)


# --- bad files: one slip in the xr701, where it is, and what the message must hold


def put(*path: str | int, value: Any) -> Callable[[Data], None]:
    def edit(data: Any) -> None:
        for step in path[:-1]:
            data = data[step]
        data[path[-1]] = value

    return edit


def drop(*path: str | int) -> Callable[[Data], None]:
    def edit(data: Any) -> None:
        for step in path[:-1]:
            data = data[step]
        del data[path[-1]]

    return edit


ANGLE = {"value": 0, "unit": "deg", "source": "assumed"}
LENGTH = {"value": 1, "unit": "m", "source": "assumed"}
TUBE = {
    "kind": "tube",
    "diameter": {"value": 0.6, "unit": "m", "source": "assumed"},
    "wall": {"value": 301, "unit": "mm", "source": "assumed"},
}
BOX = {
    "kind": "box",
    "width": {"value": 0.9, "unit": "m", "source": "assumed"},
    "height": {"value": 0.5, "unit": "m", "source": "assumed"},
    "wall": {"value": 251, "unit": "mm", "source": "assumed"},
}
SPRING = {"value": 1e6, "unit": "N m/rad", "source": "assumed"}

BAD: dict[str, tuple[Callable[[Data], None], str, list[str]]] = {
    "unknown unit": (put("mass", "unit", value="lb"), "mass.unit", ["'lb'", "allowed: kg"]),
    "unit of another dimension": (
        put("joint", 1, "limits", "unit", value="mm"),
        "joint.j2.limits.unit",
        ["'mm'", "allowed: rad, deg, mrad"],
    ),
    "missing unit": (drop("mass", "unit"), "mass.unit", ["missing", "add it"]),
    "missing source": (drop("joint", 3, "limits", "source"), "joint.j4.limits.source", ["missing", "add it"]),
    "unknown source": (
        put("mass", "source", value="rumour"),
        "file",
        ["rumour", "not listed under [sources]", "assumed, derived, definition"],
    ),
    "negative length in a section": (
        put("link", 0, "section", "diameter", "value", value=-0.6),
        "link.pedestal.section.tube.diameter.value",
        ["must be greater than 0", "-0.6"],
    ),
    "no wall at all": (
        put("link", 1, "section", "wall", "value", value=0),
        "link.carousel.section.box.wall.value",
        ["must be greater than 0", "got 0"],
    ),
    "wall too thick for a tube": (
        put("link", 0, "section", value=TUBE),
        "link.pedestal.section.tube",
        ["0.301 m", "thicker than half", "0.6 m"],
    ),
    "wall too thick for a box": (
        put("link", 1, "section", value=BOX),
        "link.carousel.section.box",
        ["0.251 m", "thicker than half", "0.9 x 0.5 m"],
    ),
    "unknown kind of section": (
        put("link", 0, "section", "kind", value="pipe"),
        "link.pedestal.section",
        ["pipe", "'box'", "'tube'"],
    ),
    "taper to another kind": (
        put("link", 0, "section_end", value=BOX | {"wall": LENGTH | {"value": 0.01}}),
        "link.pedestal",
        ["cannot taper from tube"],
    ),
    "both dh and frame": (
        put("joint", 0, "dh", value={"alpha": ANGLE, "a": LENGTH, "d": LENGTH}),
        "joint.j1",
        ["exactly one of 'dh' and 'frame'"],
    ),
    "neither dh nor frame": (drop("joint", 0, "frame"), "joint.j1", ["exactly one of 'dh' and 'frame'"]),
    "unknown key": (put("colour", value="red"), "colour", ["unknown key", "'red'", "spelling"]),
    "unknown key in a joint": (
        put("joint", 4, "stifness", value=SPRING),
        "joint.j5.stifness",
        ["unknown key", "spelling"],
    ),
    "NaN": (put("mass", "value", value=float("nan")), "mass.value", ["finite", "nan"]),
    "infinity": (put("mass", "value", value=float("inf")), "mass.value", ["finite", "inf"]),
    "NaN in a list": (
        put("joint", 1, "limits", "value", value=[float("nan"), 45]),
        "joint.j2.limits.value.0",
        ["finite", "nan"],
    ),
    "NaN in an axis": (
        put("joint", 1, "frame", "axis", value=[0, float("nan"), 0]),
        "joint.j2.frame.axis.1",
        ["finite", "nan"],
    ),
    "NaN in a coupling": (
        put("coupling", 0, "terms", 0, "factor", value=float("nan")),
        "coupling.forearm_deg.terms.0.factor",
        ["finite", "nan"],
    ),
    "list for a single value": (
        put("mass", "value", value=[1450, 3]),
        "mass.value",
        ["must be a valid number", "[1450, 3]"],
    ),
    "single value for a list": (
        put("flange", "xyz", "value", value=0.3),
        "flange.xyz.value",
        ["must be a list", "0.3"],
    ),
    "quoted number": (put("mass", "value", value="1450"), "mass.value", ["must be a valid number", "'1450'"]),
    "truth value": (put("mass", "value", value=True), "mass.value", ["must be a valid number", "True"]),
    "limits reversed": (
        put("joint", 1, "limits", "value", value=[45, -35]),
        "joint.j2.limits.value",
        ["lower < upper", "[45, -35]"],
    ),
    "axis without length": (
        put("joint", 1, "frame", "axis", value=[0, 0, 0]),
        "joint.j2.frame.axis",
        ["length zero", "[0, 0, 0]"],
    ),
    "beam_up without length": (
        put("link", 1, "beam_up", value=[0, 0, 0]),
        "link.carousel.beam_up",
        ["length zero", "[0, 0, 0]"],
    ),
    "sign that is no sign": (put("joint", 2, "sign", value=2), "joint.j3.sign", ["1 or -1", "got 2"]),
    "coordinate without its unit": (
        put("joint", 0, "coordinate", value="q1"),
        "joint.j1.coordinate",
        ["_deg", "'q1'"],
    ),
    "Poisson's ratio": (
        put("materials", "cast-steel", "poissons_ratio", "value", value=0.7),
        "materials.cast-steel.poissons_ratio",
        ["0.7", "between -1 and 0.5"],
    ),
    "spring in an unknown unit": (
        put("joint", 1, "stiffness", value=SPRING | {"unit": "Nm/rad"}),
        "joint.j2.stiffness.constant.unit",
        ["'Nm/rad'", "allowed: N m/rad"],
    ),
    "spring that pushes back": (
        put("joint", 1, "stiffness", value=SPRING | {"value": -1e6}),
        "joint.j2.stiffness.constant.value",
        ["must be greater than 0", "-1000000.0"],
    ),
    "parallelogram missing": (
        drop("parallelogram"),
        "file",
        ["load_path is 'parallelogram'", "no [parallelogram]", "load_path = 'serial'"],
    ),
    "unknown link body": (
        put("link", 4, "body", value="j9"),
        "file",
        ["unknown link body 'j9'", "base, j1, j2, j3, j4, j5, j6"],
    ),
    "unknown material": (put("link", 4, "material", value="wood"), "file", ["'wood'", "cast-steel"]),
    "unknown coordinate": (
        put("coupling", 0, "terms", 0, "coordinate", value="q3_deg"),
        "file",
        ["'q3_deg'", "q3real_deg"],
    ),
    "another schema": (
        put("schema", value="stiffarm-model/2"),
        "schema",
        ["stiffarm-model/1", "'stiffarm-model/2'"],
    ),
}


@pytest.mark.parametrize("slip", BAD)
def test_one_slip_gives_one_message_with_place_value_and_remedy(slip: str) -> None:
    edit, place, words = BAD[slip]
    data = copy.deepcopy(raw("xr701"))
    edit(data)
    error = refused(data)
    assert not isinstance(error, InputErrors), str(error)
    assert str(error).startswith(f"bad.toml: {place}: "), str(error)
    for word in words:
        assert word in str(error)
    assert error.remedy


def test_two_joints_with_the_same_name() -> None:
    data = raw("tx200")
    data["joint"][5]["name"] = "j5"
    data["link"][4]["body"] = "j5"
    error = refused(data)
    assert "joint name used twice: j5" in str(error)
    assert error.remedy


def test_all_faults_are_reported_at_once() -> None:
    data = raw("xr701")
    data["mass"]["value"] = float("nan")
    data["joint"][1]["limits"]["value"] = [45, -35]
    error = refused(data)
    assert isinstance(error, InputErrors)
    assert len(error.errors) == 2
    assert "bad.toml: 2 problem(s)" in str(error)
    assert "mass.value" in str(error)
    assert "joint.j2.limits.value" in str(error)


def test_all_faulty_references_are_reported_at_once() -> None:
    data = raw("xr701")
    data["link"][4]["body"], data["link"][3]["material"], data["mass"]["source"] = "j9", "wood", "rumour"
    error = refused(data)
    assert isinstance(error, InputErrors)
    assert len(error.errors) == 3
    for word in ("'j9'", "'wood'", "rumour"):
        assert word in str(error)


def test_an_empty_file_names_all_it_lacks() -> None:
    error = refused({})
    for key in ("schema", "name", "title", "sources", "joint", "flange"):
        assert f"bad.toml: {key}: this key is missing" in str(error)


# --- bad parallelograms: the schema accepts them, the arrays cannot be made


def test_the_parallelograms_axes_must_be_parallel() -> None:
    data = raw("xr701")
    data["joint"][2]["frame"]["axis"] = [1, 0, 0]
    error = refused(data)
    assert str(error).startswith("xr701: [parallelogram] joint axes: got '[0.0, 1.0, 0.0] and [1.0, 0.0, 0.0]'")
    assert error.allowed == "parallel, in the same direction"
    assert error.remedy


def test_the_driven_joint_must_follow_the_cranks() -> None:
    data = raw("xr701")
    data["parallelogram"]["driven"] = "j5"
    error = refused(data)
    assert "'j5'; allowed: the joint right after j2" in str(error)
    assert error.remedy


@pytest.mark.parametrize("pin", [[0, 0, 0], [0, 0.2, 0]])
def test_the_pin_must_be_off_the_axis(pin: list[float]) -> None:
    data = raw("xr701")
    data["parallelogram"]["pin"]["value"] = pin
    error = refused(data)
    assert "a point off the driven joint's axis" in str(error)
    assert error.remedy


def test_the_pins_lever_is_taken_in_the_driven_bodys_frame() -> None:
    """The elbow's frame rolled by 90 deg: its axis is z there, though it is y in the upper arm."""
    data = raw("xr701")
    frame = data["joint"][2]["frame"]
    frame["rpy"] = {"value": [-90, 0, 0], "unit": "deg", "source": "assumed"}
    frame["axis"] = [0, 0, 1]
    data["parallelogram"]["pin"]["value"] = [0, 0.3, 0]
    robot_from(parse_description(tomlkit.dumps(data), "rolled"))
    data["parallelogram"]["pin"]["value"] = [0, 0, 0.3]
    assert "a point off the driven joint's axis" in str(refused(data))


# --- files on disk


def test_unreadable_toml_names_file_line_and_remedy(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text('schema = "stiffarm-model/1"\nname "arm"\n', encoding="utf-8")
    caught = refuses("F005", r"arm\.toml is not valid TOML.*line 2", load_description, path)
    assert caught.remedy


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_bytes(b"\xff\xfe\x00\x01")
    refuses("F004", r"arm\.toml cannot be read", load_description, path)


@pytest.mark.parametrize("make_folder", [False, True])
def test_a_missing_file_lists_the_bundled_robots(tmp_path: Path, make_folder: bool) -> None:
    path = tmp_path / "no-such-arm.toml"
    if make_folder:
        path.mkdir()
    caught = refuses("R001", rf"{re.escape(str(path))}.*kr60-3, tx200, xr701", load_description, path)
    assert "stiffarm robots" in str(caught.remedy)


def test_a_saved_model_reads_back_and_nothing_else_is_left(tmp_path: Path) -> None:
    description = load_description("xr701")
    path = tmp_path / "mine.toml"
    save_description(description, path)
    assert load_description(path) == description
    assert os.listdir(tmp_path) == ["mine.toml"]


def test_a_model_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("precious", encoding="utf-8")
    caught = refuses("F009", r"mine\.toml exists already", save_description, load_description("xr701"), path)
    assert caught.remedy
    assert path.read_text(encoding="utf-8") == "precious"
    assert os.listdir(tmp_path) == ["mine.toml"]


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    caught = refuses(
        "F008",
        r"nowhere does not exist",
        save_description,
        load_description("xr701"),
        tmp_path / "nowhere" / "mine.toml",
    )
    assert caught.remedy


def test_a_write_that_fails_leaves_no_temporary_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: Path, target: Path) -> Path:
        raise OSError("no space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(OSError, match="no space"):
        save_description(load_description("xr701"), tmp_path / "mine.toml")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("name", ["kr60-3", "tx200", "xr701"])
def test_tables_that_a_user_adds_are_read(name: str) -> None:
    """An empty list of a kind of tables would stand in the way of the first one that is pasted in."""
    text = to_toml(load_description(name))
    assert "= []" not in text.partition("\n[")[0]
    effect = (
        '\n[[effect]]\ncode = "base-tilt"\nparameters.stiffness_y = { value = 2e7, unit = "N m/rad", source = "s" }\n'
    )
    assert len(parse_description(text.replace("[sources]", '[sources]\ns = "own"', 1) + effect, "pasted").effect) == 1


def test_an_empty_list_in_the_way_of_a_table_is_named() -> None:
    text = "link = []\n" + to_toml(load_description("kr60-3")) + '\n[[link]]\nname = "a"\n'
    refuses("F005", r"link = \[\] is above it.*remove the line", parse_description, text, "pasted")
