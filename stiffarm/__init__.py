"""How stiff is my robot arm, here, in this pose, and why does the model say something else than my gauge: stiffarm.

``import stiffarm as sa`` is the Python face of the same steps that the command line runs. Names load what they need
when they are first used: this file runs before the command line can heed Ctrl-C.
"""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from robots import InputError, InputErrors
    from stiffarm.commands.fit.command import fit
    from stiffarm.commands.index.command import index
    from stiffarm.commands.maps.command import Map, map_box, map_cylinder, map_index, map_joints, map_slice
    from stiffarm.commands.query.command import Surrogate, load_surrogate, query
    from stiffarm.commands.run.command import run
    from stiffarm.commands.sensitivity.command import sensitivity
    from stiffarm.commands.simulate.command import simulate
    from stiffarm.face.arms import Arm, load, robots_bundled
    from stiffarm.face.calibrations import Calibration, calibrate
    from stiffarm.face.comparisons import Comparison, compare
    from stiffarm.face.conversions import ConvertedReadings, convert_readings
    from stiffarm.face.diagnoses import Diagnosis, diagnose
    from stiffarm.face.identification import Identification, identify
    from stiffarm.face.imports import Imported, import_arm, import_link
    from stiffarm.face.missing_positions import PositionDiagnosis, diagnose_positions
    from stiffarm.face.new_arms import KinematicsCheck, NewArm, check_kinematics, new_arm
    from stiffarm.face.plans import Plan, plan
    from stiffarm.face.positions import PositionCalibration, calibrate_positions
    from stiffarm.face.power import PowerAnalysis, power
    from stiffarm.face.programs import Checked, Program, post, verify
    from stiffarm.face.readings import Readings, bundled, read_readings
    from stiffarm.face.rehearsals import Rehearsal, rehearse
    from stiffarm.face.shop import Placement, Posture, place, posture
    from stiffarm.result import Result

    __version__: str

# What stiffarm is made of; a folder of one of these names beside a script would be taken in its place.
_PARTS = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal")

__all__ = [
    "Arm",
    "Calibration",
    "Checked",
    "Comparison",
    "ConvertedReadings",
    "Diagnosis",
    "Identification",
    "Imported",
    "InputError",
    "InputErrors",
    "KinematicsCheck",
    "Map",
    "NewArm",
    "Placement",
    "Plan",
    "PositionCalibration",
    "PositionDiagnosis",
    "Posture",
    "PowerAnalysis",
    "Program",
    "Readings",
    "Rehearsal",
    "Result",
    "Surrogate",
    "bundled",
    "calibrate",
    "calibrate_positions",
    "check_kinematics",
    "compare",
    "convert_readings",
    "diagnose",
    "diagnose_positions",
    "fit",
    "identify",
    "import_arm",
    "import_link",
    "index",
    "load",
    "load_surrogate",
    "map_box",
    "map_cylinder",
    "map_index",
    "map_joints",
    "map_slice",
    "new_arm",
    "place",
    "plan",
    "post",
    "posture",
    "power",
    "query",
    "read_readings",
    "rehearse",
    "robots_bundled",
    "run",
    "sensitivity",
    "simulate",
    "verify",
]

# What had another name in 0.1.
_MOVED = {"replay": "stiffarm.simulate(arm, data=readings)"}


def __getattr__(name: str) -> object:
    """A public name, or the version, looked up when it is asked for."""
    if name == "__version__":
        from importlib.metadata import version

        return version("stiffarm")
    if name in _MOVED:
        raise AttributeError(f"stiffarm.{name} is {_MOVED[name]} now")
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    refuse_strangers()
    from robots.lazily import lazily

    return lazily(__name__)(name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


def refuse_strangers() -> None:
    """Raise ImportError where Python takes a user's own folder or file for a part of stiffarm."""
    from importlib.util import find_spec
    from pathlib import Path

    home = Path(__file__).resolve().parent.parent
    for part in _PARTS:
        spec = find_spec(part)
        places = [] if spec is None else [spec.origin] if spec.origin else list(spec.submodule_search_locations or ())
        if not places:
            raise ImportError(
                f"stiffarm's own package {part!r} is missing: what is installed is not whole, or older than the "
                "sources. To fix it: install stiffarm again"
            )
        if [Path(str(place)).resolve() for place in places] != [home / part / "__init__.py"]:
            raise ImportError(
                f"stiffarm's own package {part!r} is hidden by {places[0]}. "
                "To fix it: rename that folder or file, or start Python in another folder"
            )
