"""A URDF file's text, checked before yourdfpy reads it: what it would stumble over is said in plain words.

Materials, inertia tensors, transmissions and simulator settings are dropped here: nothing below uses them.
"""

from __future__ import annotations

import hashlib
import io
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robots.errors import InputError, raise_any, twice
from robots.files.reading import BYTE_ORDER_MARK, read_bytes

JOINT_TYPES = ("revolute", "continuous", "fixed", "prismatic", "floating", "planar")
# Element -> attribute -> how many numbers it may hold.
_NUMBERS: dict[str, dict[str, tuple[int, ...]]] = {
    "origin": {"xyz": (3,), "rpy": (3,)},
    "axis": {"xyz": (3,)},
    "limit": {"lower": (1,), "upper": (1,)},
    "mass": {"value": (1,)},
    "mimic": {"multiplier": (1,), "offset": (1,)},
    "mesh": {"scale": (1, 3)},
    "box": {"size": (3,)},
    "cylinder": {"radius": (1,), "length": (1,)},
    "sphere": {"radius": (1,)},
}
# Metres, radians, kilograms and factors of any robot are far smaller, and products of these figures still hold. Limits
# alone are often "endless"; those of the arm's own joints are checked with the arm.
_LARGEST, _LARGEST_LIMIT = 1e6, 1e30
_NEEDED = {"mesh": ("filename",), "box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}
_KEPT = {
    "robot": {"link", "joint"},
    "link": {"inertial", "visual", "collision"},
    "inertial": {"origin", "mass"},
    "visual": {"origin", "geometry"},
    "collision": {"origin", "geometry"},
    "joint": {"parent", "child", "origin", "axis", "limit", "mimic"},
}


@dataclass(frozen=True)
class UrdfText:
    """yourdfpy's dataclasses of a whole file (``robot``), the file's SHA-256, and what had to be said."""

    robot: Any
    sha256: str
    notes: tuple[str, ...]


def is_xml(path: Path) -> bool:
    """Whether a file is named or begins like a URDF (or another XML file)."""
    if path.suffix.lower() in (".urdf", ".xacro"):
        return True
    start = read_bytes(path, "model file")[:256]
    return start.removeprefix(BYTE_ORDER_MARK).lstrip().startswith(b"<")


def read_urdf_text(path: Path) -> UrdfText:
    """Read a URDF; links and joints are checked one by one, how they hang together is not.

    Raises
    ------
    InputError
        Unreadable file, no XML, a document type declaration, another root than ``robot``, a xacro file, and
        all faults of links and joints at once.
    """
    data = read_bytes(path, "URDF")
    root = _root(path, data)
    _refuse_xacro(path, root)
    notes: list[str] = []
    if not root.get("name"):
        root.set("name", path.stem)
        notes.append(f"the robot has no name in the file: called {path.stem}")
    _drop_unused(root)
    notes += _drop_shapes_without_form(root)
    raise_any(f"URDF {path.name}", [*_faults_of_links(root), *_faults_of_joints(root), *_faults_of_numbers(root)])
    return UrdfText(_yourdfpy_robot(root), hashlib.sha256(data).hexdigest(), tuple(notes))


def _yourdfpy_robot(root: Any) -> Any:
    # Here, since this import takes a second that models from TOML need not wait for.
    import yourdfpy  # type: ignore[import-untyped]
    from lxml import etree  # type: ignore[import-untyped]

    text = io.BytesIO(etree.tostring(root))
    return yourdfpy.URDF.load(text, build_scene_graph=False, load_meshes=False).robot


def _root(path: Path, data: bytes) -> Any:
    from lxml import etree

    parser = etree.XMLParser(
        recover=True, resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True
    )
    try:
        root = etree.fromstring(data.removeprefix(BYTE_ORDER_MARK).lstrip(), parser)
    except etree.XMLSyntaxError as error:
        raise InputError(f"URDF {path} is no XML ({error.msg})", code="R011", remedy="export it again") from error
    # Old files use prefixes of simulators without declaring them; that harms nothing here.
    errors = [entry for entry in parser.error_log if entry.domain_name != "NAMESPACE"]
    if root is None or errors:
        where = f"line {errors[0].line}: {errors[0].message}" if errors else "nothing in it"
        raise InputError(
            f"URDF {path} is no XML ({where})", code="R011", remedy="mend the file there, or export it again"
        )
    if root.getroottree().docinfo.doctype:
        raise InputError(
            f"URDF {path} has a document type (<!DOCTYPE>)", code="R011", remedy="remove it: URDF needs none"
        )
    if root.tag != "robot":
        raise InputError(
            f"URDF {path}: outermost element",
            code="R011",
            value=str(root.tag),
            allowed="robot",
            remedy="give the robot's URDF, not an SDF, a launch file or a mesh",
        )
    return root


def _refuse_xacro(path: Path, root: Any) -> None:
    marks = [e for e in root.iter() if re.match(r"xacro:|\{[^}]*xacro[^}]*\}", str(e.tag))]
    marks += [e for e in root.iter() if any("${" in v or "$(" in v for v in e.attrib.values())]
    if marks or path.suffix.lower() == ".xacro":
        place = f", line {marks[0].sourceline}" if marks else ""
        raise InputError(
            f"{path.name} is a xacro file{place}, a recipe for a URDF",
            code="R012",
            remedy=f"expand it first: xacro {path.name} > {path.name.split('.')[0]}.urdf",
        )


def _drop_unused(root: Any) -> None:
    for element in list(root.iter()):
        for child in list(element) if element.tag in _KEPT else []:
            if child.tag not in _KEPT[element.tag]:
                element.remove(child)
    for limit in root.iter("limit"):
        for attribute in set(limit.attrib) - {"lower", "upper"}:
            del limit.attrib[attribute]


def _drop_shapes_without_form(root: Any) -> list[str]:
    """Remove visuals and collisions whose geometry says nothing that can be used; a note for each."""
    notes = []
    for shape in [*root.iter("visual"), *root.iter("collision")]:
        forms = [child for geometry in shape.findall("geometry") for child in geometry]
        if len(forms) != 1 or forms[0].tag not in _NEEDED or any(not forms[0].get(k) for k in _NEEDED[forms[0].tag]):
            found = ", ".join(str(form.tag) for form in forms) or "nothing"
            link = shape.getparent()
            notes.append(f"link {link.get('name')}: a {shape.tag} left out (its geometry holds {found})")
            link.remove(shape)
    return notes


def _place(element: Any) -> str:
    """Name the link or joint that an element stands in."""
    owner = next((e for e in (element, *element.iterancestors()) if e.tag in ("link", "joint")), element)
    return f"{owner.tag} {owner.get('name') or f'at line {owner.sourceline}'}"


def _faults_of_links(root: Any) -> Iterator[InputError]:
    yield from _faults_of_names(root, "link")
    for mass in root.iter("mass"):
        value = _numbers(mass.get("value", "0"))
        if value and value[0] < 0.0:
            yield InputError(
                f"{_place(mass)}: mass", code="R013", value=value[0], allowed="0 kg or more", remedy="correct it"
            )


def _faults_of_joints(root: Any) -> Iterator[InputError]:
    yield from _faults_of_names(root, "joint")
    links = {link.get("name") for link in root.findall("link")}
    for joint in root.findall("joint"):
        for what, place, known, allowed in (
            ("type", "@type", set(JOINT_TYPES), ", ".join(JOINT_TYPES)),
            ("parent link", "parent/@link", links, "the name of a link of the file"),
            ("child link", "child/@link", links, "the name of a link of the file"),
        ):
            value = joint.xpath(f"string({place})")
            if value not in known:
                yield InputError(
                    f"{_place(joint)}: {what}",
                    code="R013",
                    value=value or "none",
                    allowed=allowed,
                    remedy="correct it in the file",
                )


def _faults_of_numbers(root: Any) -> Iterator[InputError]:
    for element in root.iter(*_NUMBERS):
        for attribute, counts in _NUMBERS[element.tag].items():
            text = element.get(attribute)
            fault = None if text is None else _fault_of_numbers(element.tag, text, counts)
            if fault is not None:
                yield InputError(
                    f"{_place(element)}: {element.tag} {attribute}",
                    code="R013",
                    value=text,
                    allowed=fault[0],
                    remedy=fault[1],
                )


def _fault_of_numbers(tag: str, text: str, counts: tuple[int, ...]) -> tuple[str, str] | None:
    """What is allowed in place of an attribute's text and what to do, or None where it can be taken."""
    remedy, numbers = "correct it in the file", _numbers(text)
    if numbers is None or len(numbers) not in counts:
        count = " or ".join(str(c) for c in counts)
        return f"{count} finite number{'s' if counts != (1,) else ''}, separated by spaces", remedy
    most = _LARGEST_LIMIT if tag == "limit" else _LARGEST
    if max(map(abs, numbers)) > most:
        return f"at most {most:g} in size", f"{remedy}; URDF has metres, radians and kilograms"
    return ("numbers other than zero", remedy) if tag in _NEEDED and 0.0 in numbers else None


def _numbers(text: str) -> list[float] | None:
    """The finite numbers of an attribute, or None."""
    try:
        numbers = [float(item) for item in text.split()]
    except ValueError:
        return None
    return numbers if all(math.isfinite(number) for number in numbers) else None


def _faults_of_names(root: Any, kind: str) -> Iterator[InputError]:
    elements = root.findall(kind)
    for element in elements:
        if not element.get("name"):
            yield InputError(f"{kind} at line {element.sourceline} has no name", code="R013", remedy="give it one")
    for name in twice(element.get("name") for element in elements if element.get("name")):
        yield InputError(
            f"{kind} name used twice", code="R013", value=name, allowed="each name once", remedy="rename one"
        )
