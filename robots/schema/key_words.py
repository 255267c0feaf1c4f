"""What each key of a model file means: for the JSON schema, the key reference and the comments of new model files.

One sentence a key, by the class of its table. A test asks that every key of every class has one.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, Final

from robots.schema.description import ModelDescription
from robots.schema.quantities import Quantity
from robots.schema.units import DIMENSIONS

_QUANTITY: Final = {
    "value": "The number, or the list of numbers.",
    "unit": "Its unit.",
    "source": "A key of [sources], or assumed, derived or definition.",
    "note": "What else is worth knowing of it.",
}
_SIX: Final = {
    **{f"t{a}": f"Stiffness against displacement along {a}." for a in "xyz"},
    **{f"r{a}": f"Stiffness against rotation about {a}." for a in "xyz"},
}
_PLACED: Final = {
    "xyz": "Position in the frame before it.",
    "rpy": "Roll, pitch and yaw about the fixed x, y, z of the frame before it. Default: not turned.",
}

KEY_WORDS: Final = MappingProxyType(
    {
        "ModelDescription": {
            "schema": "Version of this format.",
            "name": "Short name, used in messages and file names.",
            "title": "Full name, used on pages.",
            "notes": "Sentences that whoever uses the model should know.",
            "load_path": "serial, or parallelogram where a bar drives the forearm.",
            "sources": "Where figures come from: a key for each source, with a sentence that lets one find it again.",
            "mass": "Mass of the whole robot.",
            "payload": "Rated payload. Results per newton are judged by its weight.",
            "beam_radius": "Radius of the capsules that stand for bodies without a known shape.",
            "materials": "Materials by name, for the links.",
            "joint": "The joints, from the base to the flange.",
            "flange": "The mounting plate in the last joint's frame.",
            "tool": "The tool point in the flange frame. Default: the flange itself.",
            "base": "How the floor or pedestal deflects, base axes. Default: rigid.",
            "load": "Where test loads really act, if not at the tool point.",
            "link": "The links' casings. Without any, links are rigid.",
            "parallelogram": "The bar and crank that drive the forearm.",
            "coupling": "Limits on sums of coordinates.",
            "controller": "How the controller counts angles, where its frames are and which programs it reads.",
            "effect": "Further effects, such as backlash, with their figures.",
            "calibration": "Written by calibrate: where calibrated springs come from.",
            "positions": "Written by calibrate: where errors of the geometry come from.",
        },
        "Joint": {
            "name": "Short name of the joint, as in j2.",
            "coordinate": "Name of its angle in tables and options; must end in _deg.",
            "dh": "Place of the joint by modified Denavit-Hartenberg parameters (or give frame).",
            "frame": "Place and axis of the joint in the frame of the body before it (or give dh).",
            "sign": "-1 if a growing coordinate turns against the axis. Default: 1.",
            "offset": "Angle of the joint where its coordinate reads 0. Default: 0.",
            "limits": "Lowest and highest value of the coordinate.",
            "stiffness": "Spring about the axis: a figure, or a law over angles. Default: rigid.",
            "tilt_stiffness": "Stiffness against both tilts across the axis. Default: rigid.",
            "translational_stiffness": "Stiffness against displacement in all three directions. Default: rigid.",
            "bearing": "The five other directions one by one, in place of tilt_ and translational_stiffness.",
            "bearing_laws": "Directions across the axis whose stiffness varies with a joint's angle.",
            "zero_error": "Added to the coordinate: what the joint really turned when the controller says 0.",
            "error": "What positions told of the joint beside its zero; written by calibrate.",
        },
        "JointError": {
            **{a: f"The joint's frame is moved along its own {a}." for a in "xy"},
            "z": "The joint's frame is moved along its axis.",
            "rx": "The joint's frame is turned about its own x.",
            "ry": "The joint's frame is turned about its own y.",
            "ratio": "By how much more the joint turns than it says.",
            "turns_with": "Other joints that it turns with.",
            "curve": "Its error over its coordinate.",
        },
        "TurnsWith": {"joint": "The other joint.", "factor": "How much this joint turns for each turn of the other."},
        "ErrorCurve": {
            "sin_mrad": "Sines, one for each order from 1 on, mrad.",
            "cos_mrad": "Cosines, one for each order from 1 on, mrad.",
            "identified_deg": "Ranges of the coordinate where readings tell the curve.",
            "height_mrad": "Its standard deviation where they do not.",
            "source": "A key of [sources], or assumed, derived or definition.",
        },
        "Positions": {
            "data": "The readings.",
            "data_sha256": "Hash of the readings.",
            "before_rms_mm": "RMS distance with the arm as described.",
            "rms_mm": "RMS distance, calibrated.",
            "left_out_rms_mm": "RMS distance at readings that were predicted by the others.",
            "notes": "Remarks.",
            "parameters": "Parameters beside error curves.",
            "covariance": "Their covariance, in SI; stiffnesses as compliances.",
        },
        "DHRow": {
            "alpha": "Angle from the previous axis to this one, about the previous x axis (alpha_{i-1}).",
            "a": "Distance from the previous axis to this one, along the previous x axis (a_{i-1}).",
            "d": "Distance along this axis.",
        },
        "FrameRow": {**_PLACED, "axis": "Direction of the joint's axis in this frame. Default: z."},
        "Flange": _PLACED,
        "Placed": _PLACED,
        "Tool": {**_PLACED, "stiffness": "Stiffness of the tool or a force sensor, flange axes. Default: rigid."},
        "LoadPlacement": {
            "point": "What points that readings bring themselves are off by, flange axes.",
            "offset": "Distance of the load from the point that is read, flange axes.",
            "tilt": "Turn of the load about the base's x, y, z.",
        },
        "Coupling": {
            "name": "Name of the sum, for messages.",
            "terms": "Coordinates and their factors.",
            "offset": "Added to the sum. Default: 0.",
            "limits": "Lowest and highest value of the sum.",
        },
        "CouplingTerm": {"coordinate": "A joint's coordinate.", "factor": "Its factor in the sum."},
        "Controller": {
            "axes": "Names of the controller's angles, one for each joint, ending in _deg. Default: the coordinates.",
            "angle": "Coordinates that are not simply the controller's angle in the same place.",
            "formats": "Program formats that it reads, counting angles so: krl, rapid, val3, urscript, sinumerik.",
            "base": "Its robot frame in the model's base frame. Default: not known.",
            "flange": "Its flange frame in the model's flange frame. Default: the same.",
        },
        "ControllerAngle": {
            "coordinate": "The joint's coordinate that this row makes.",
            "terms": "The controller's angles and their factors.",
            "offset": "Added to the sum. Default: 0.",
            "note": "What else is worth knowing of it.",
        },
        "AxisTerm": {"axis": "One of the controller's axes.", "factor": "Its factor in the sum."},
        "Material": {
            "youngs_modulus": "Modulus of elasticity.",
            "poissons_ratio": "Poisson's ratio.",
            "density": "Density.",
        },
        "Link": {
            "name": "Short name of the link.",
            "body": "base, or the joint that it moves with.",
            "material": "A key of [materials].",
            "section": "Cross-section at its root.",
            "section_end": "Cross-section at its tip, if it tapers.",
            "via": "Points that its centre line runs through between its joints, in the body's frame.",
            "rigid_to": "Rigid from its own joint to this point of the body's frame, where its beam starts.",
            "rigid_from": "Rigid from this point of the body's frame, where its beam ends, to the next joint.",
            "beam_up": "Direction in the body's frame that the section's height follows.",
            "mass": "Mass of the whole link, with drives and cables.",
            "opening": "Holes in the walls of a box casing (shell links).",
            "rim": "Thicker wall at both ends (shell links).",
            "surface": "Prepared shell mesh in place of the casing; written by import.",
            "solid": "Prepared mesh of tetrahedra, of the material itself (solid links); written by import.",
            "flanges": "How an end is coupled, by end (root, tip, pin): rigid or distributing (shell links).",
            "youngs_modulus": "Modulus of this link in place of its material's.",
        },
        "BoxSection": {
            "kind": "box: a hollow rectangle.",
            "width": "Outer size along the section's y.",
            "height": "Outer size along the section's z.",
            "wall": "Wall thickness.",
        },
        "TubeSection": {"kind": "tube: a hollow circle.", "diameter": "Outer diameter.", "wall": "Wall thickness."},
        "Opening": {
            "side": "The wall, by its outward direction in the section's axes.",
            "along": "From and to, as shares of the centre line from root to tip.",
            "across": "From and to, as shares of the wall.",
            "source": "A key of [sources], or assumed, derived or definition.",
            "note": "What else is worth knowing of it.",
        },
        "Rim": {"length": "Length of the thicker wall from each end.", "wall": "Its thickness."},
        "Surface": {
            "file": "The mesh, relative to the model file.",
            "sha256": "Hash of its content.",
            "wall": "Wall thickness.",
            "size": "Size of its elements.",
            "source": "Where it came from.",
            "changes": "What was done to the source.",
        },
        "Solid": {
            "file": "The mesh, relative to the model file.",
            "sha256": "Hash of its content.",
            "size": "Size of its elements.",
            "source": "Where it came from.",
            "changes": "What was done to the source.",
        },
        "ParallelogramBar": {
            "driven": "The joint that the bar drives.",
            "crank_about": "The joint whose axis the crank turns about.",
            "pin": "The bar's pin on the driven link, in that body's frame.",
            "bar": "Cross-section of the bar.",
            "bar_material": "A key of [materials].",
            "crank": "Cross-section of the crank.",
            "crank_material": "A key of [materials].",
            "bar_stiffness": "Stiffness along the bar in place of what its section gives.",
            "crank_flanges": "How the crank's ends are coupled: rigid or distributing (shell links).",
        },
        "PlaceStiffness": {**_SIX, "entry": "Entries of the compliance matrix off the diagonal."},
        "ComplianceEntry": {"rows": "The two directions.", "compliance": "The entry."},
        "BearingLaws": {
            name: text.replace("Stiffness", "Law of the stiffness") for name, text in _SIX.items() if name != "rz"
        },
        "LogPolynomialLaw": {
            "kind": "log-polynomial: ln k is a polynomial in scaled angles.",
            "inputs": "The coordinates that it depends on.",
            "centre_deg": "Middle of each.",
            "half_range_deg": "Half range of each, by which it is scaled.",
            "exponents": "A row of exponents for each coefficient.",
            "coefficients": "The coefficients of ln k.",
            "source": "A key of [sources], or assumed, derived or definition.",
        },
        "LogFourierLaw": {
            "kind": "log-fourier: ln k is a mean with cosines and sines of one angle.",
            "input": "The coordinate that it depends on.",
            "coefficients": "The mean, then a cosine and a sine for each order.",
            "source": "A key of [sources], or assumed, derived or definition.",
        },
        "TableLaw": {
            "kind": "table: ln k is linear between nodes of one angle.",
            "input": "The coordinate that it depends on.",
            "nodes_deg": "The nodes, rising.",
            "stiffness_Nm_per_rad": "The stiffness at each node.",
            "source": "A key of [sources], or assumed, derived or definition.",
        },
        "EffectTable": {
            "code": "Family and place of the effect, as in backlash:j2.",
            "parameters": "Its figures by name. One that is missing is zero.",
            "note": "What else is worth knowing of it.",
        },
        "Calibration": {
            "scheme": "How it was calibrated.",
            "load_path": "The load path taken.",
            "links": "The link model taken.",
            "data": "The readings.",
            "data_sha256": "Hash of the readings.",
            "rms_mm": "What was left, RMS.",
            "loads_N": "The loads used.",
            "notes": "Remarks.",
            "uncertainty": "How sure its figures are.",
        },
        "CalibrationUncertainty": {
            "parameters": "Names of the parameters.",
            "unit": "Their units.",
            "variable": "What the covariance is of: one over the value, its logarithm, or the value.",
            "estimate": "The variables at the file's figures.",
            "covariance": "Their covariance.",
            "degrees_of_freedom": "Of Student's t.",
            "status": "How well each is determined.",
            "undetermined_directions": "Combinations that no reading determines.",
            "undetermined": "Parameters that have no variance.",
            "note": "Remark.",
        },
        "UndeterminedNumber": {
            "name": "Name of the parameter.",
            "status": "Why it has no variance.",
            "unit": "Its unit.",
            "low": "Lower end of what the readings allow.",
            "high": "Upper end of it.",
            "note": "Remark.",
        },
    }
)


def words_of(table: str, key: str) -> str:
    """The sentence of a key, by the name of its table's class."""
    return KEY_WORDS[table][key] if table in KEY_WORDS else _QUANTITY[key]


def json_schema() -> dict[str, Any]:
    """The JSON schema of model files, for editors: every key explained, the units of each quantity listed."""
    schema = ModelDescription.model_json_schema(by_alias=True)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "stiffarm model file"
    schema["description"] = "A robot: joints, limits, springs, links, controller. Every figure has value, unit, source."
    kinds = _quantities()
    for name, table in {"ModelDescription": schema, **schema["$defs"]}.items():
        for key, entry in table["properties"].items():
            entry["description"] = words_of(name, key)
            entry.pop("title", None)
        if name in kinds:
            table["properties"]["unit"]["enum"] = list(DIMENSIONS[kinds[name].dimension].units)
            table.pop("description", None)
        elif "description" in table and name != "ModelDescription":
            table["description"] = str(table["description"]).split("\n")[0].replace("``", "")
    return schema


def _quantities() -> dict[str, type[Quantity]]:
    """Quantities by the name of their class, where units are of one dimension."""
    found: dict[str, type[Quantity]] = {}
    waiting = [Quantity]
    while waiting:
        kind = waiting.pop()
        waiting += kind.__subclasses__()
        if kind.dimension:
            found[kind.__name__] = kind
    return found
