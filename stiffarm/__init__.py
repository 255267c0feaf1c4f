"""How stiff is my robot arm, here, in this pose, and why does the model say something else than my gauge: stiffarm.

``import stiffarm as sa`` is the Python face of the same steps that the command line runs. Names load what they need
when they are first used: this file runs before the command line can heed Ctrl-C.
"""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from robots import InputError, InputErrors
    from stiffarm.arm import Arm
    from stiffarm.commands.calibrate.command import calibrate
    from stiffarm.commands.calibrate.results import Calibration
    from stiffarm.commands.compare.command import Comparison, compare
    from stiffarm.commands.diagnose.command import diagnose
    from stiffarm.commands.diagnose.result import Diagnosis
    from stiffarm.commands.fit.command import fit
    from stiffarm.commands.identify.command import identify
    from stiffarm.commands.importing.command import import_arm
    from stiffarm.commands.index.command import index
    from stiffarm.commands.maps.command import Map, map_box, map_cylinder, map_index, map_joints, map_slice
    from stiffarm.commands.new.command import NewArm, new_arm
    from stiffarm.commands.place.command import place
    from stiffarm.commands.plan.command import plan
    from stiffarm.commands.plan.results import Plan
    from stiffarm.commands.post.command import post
    from stiffarm.commands.posture.command import posture
    from stiffarm.commands.query.command import Surrogate, load_surrogate, query
    from stiffarm.commands.readings.command import ConvertedReadings, convert_readings
    from stiffarm.commands.rehearse.command import rehearse
    from stiffarm.commands.rehearse.results import Rehearsal
    from stiffarm.commands.robots.check import KinematicsCheck, check_kinematics
    from stiffarm.commands.robots.command import robots
    from stiffarm.commands.run.command import run
    from stiffarm.commands.sensitivity.command import sensitivity
    from stiffarm.commands.simulate.command import simulate
    from stiffarm.commands.verify.command import verify
    from stiffarm.loaded import Readings, bundled, load, read_readings
    from stiffarm.result import Result

    __version__: str

# What stiffarm is made of; a folder of one of these names beside a script would be taken in its place.
_PARTS = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal")

__all__ = [
    "Arm",
    "Calibration",
    "Comparison",
    "ConvertedReadings",
    "Diagnosis",
    "InputError",
    "InputErrors",
    "KinematicsCheck",
    "Map",
    "NewArm",
    "Plan",
    "Readings",
    "Rehearsal",
    "Result",
    "Surrogate",
    "bundled",
    "calibrate",
    "check_kinematics",
    "compare",
    "convert_readings",
    "diagnose",
    "fit",
    "identify",
    "import_arm",
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
    "query",
    "read_readings",
    "rehearse",
    "robots",
    "run",
    "sensitivity",
    "simulate",
    "verify",
]

# What had another name in 0.1.
_MOVED = {
    "import_link": "stiffarm.import_arm(file, model=arm, link=name)",
    "robots_bundled": 'stiffarm.robots().to_frame()["name"]',
    "power": "stiffarm.rehearse(arm, sheet)",
    "diagnose_positions": "stiffarm.diagnose(arm, positions)",
    "PositionCalibration": "stiffarm.Calibration",
    "calibrate_positions": "stiffarm.calibrate(arm, table)",
    "replay": "stiffarm.simulate(arm, data=readings)",
}


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
