"""What was learned: regression with error bars, query, stiffness maps, VTK."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from surrogate.arm_scope import inputs_that_matter, scope_of
    from surrogate.asking import QueryResult, full_poses, query
    from surrogate.maps.data import MapData
    from surrogate.maps.layouts import default_sweep
    from surrogate.model import (
        ErrorFigures,
        Quantity,
        Surrogate,
        compliance_matrix,
        predict,
        predict_compliance,
    )
    from surrogate.storage import load_surrogate, save_surrogate
    from surrogate.tasks import Task, task_of
    from surrogate.training import Trained, train
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "ErrorFigures",
    "MapData",
    "Quantity",
    "QueryResult",
    "Surrogate",
    "Task",
    "Trained",
    "compliance_matrix",
    "default_sweep",
    "full_poses",
    "inputs_that_matter",
    "load_surrogate",
    "predict",
    "predict_compliance",
    "query",
    "save_surrogate",
    "scope_of",
    "task_of",
    "train",
]
