"""A calibrated description with where it came from: readings, scheme, what is known of its parameters."""

from __future__ import annotations

from collections.abc import Sequence

from doe.estimation.calibration import Calibration
from doe.model_file.uncertainty_table import NO_COVARIANCE, NO_SPARE, calibration_table
from doe.tables.measurements import Measurements
from fem.effects import LOAD_PATH
from robots import ModelDescription
from robots.schema.description import Calibration as Origin

SOURCE_KEY = "calibrated"


def with_origin(
    found: Calibration, data: Measurements, loads_N: Sequence[float] = (), notes: Sequence[str] = ()
) -> ModelDescription:
    """The description that a calibration ends with, its table of covariances and its source.

    ``data``: the readings used; ``loads_N``: their loads as asked for, empty for all; ``notes``: remarks to keep.
    """
    scheme = "staged" if found.studies else "global"
    has_path = any(table.code == LOAD_PATH for table in found.description.effect)
    sure = calibration_table(found)
    why = () if sure is not None else (NO_COVARIANCE if found.studies else NO_SPARE,)
    changed = found.description.model_copy(
        update={
            # With an effect load-path the file keeps the path that it departs from.
            "load_path": found.description.load_path if has_path else found.model.load_path,
            "sources": {
                **found.description.sources,
                SOURCE_KEY: f"{scheme} calibration on {data.source}, SHA-256 {data.sha256}",
            },
            "calibration": Origin(
                scheme=scheme,
                load_path=found.model.load_path,
                links=found.model.link_kind,
                data=data.source,
                data_sha256=data.sha256,
                rms_mm=found.rms_mm,
                loads_N=tuple(loads_N),
                notes=(*notes, *why),
                uncertainty=sure,
            ),
        }
    )
    # Through the validator once more: a written file must be one that can be read.
    return ModelDescription.model_validate(changed.model_dump(by_alias=True))
