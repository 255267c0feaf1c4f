"""What a set is asked to be."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class SetSpec:
    """One set of readings. With the seed it fixes everything, the truth and the noise.

    ``effects`` holds codes as the issue writes them, or names of ``outside.KINDS``, or nothing at all.
    """

    robot: str = "xr701"  # or "kr60-3"
    effects: tuple[str, ...] = ()
    poses: int = 27
    design: str = "filling"  # or "paper": the XR701's nine seed poses
    order: str = "random"  # or "sorted": by reach, then what follows the clock follows the pose
    links: str = "rigid"  # or "beam": what the truth has, and what the model is to be run with
    model_path: str = "own"  # or "other": load path of the model given to the workflow (for load-path)
    reads: str = "z"  # or "xyz"
    load_axes: str = "z"  # or "xyz": cycles of loads along x and y beside the vertical ones
    up_down: bool = True
    repeats: int = 3
    noise_share: float = 0.03
    floor_um: float | None = None  # None: drawn from 2 to 5
    resolution_um: float = 1.0
    setup_scatter: float = 0.005
    nuisance: bool = True
    weight_error: float = 0.001  # each weight's own, beside half a percent that all share
    laws: tuple[str, ...] = ()  # names of the truth laws wanted, by effect; empty: drawn
    name: str = ""
    group: str = "single"  # single | none | outside | pair, for the study's own sorting

    def as_dict(self) -> dict[str, Any]:
        """Plain values for the key file."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> SetSpec:
        """The spec of a key file."""
        return cls(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
