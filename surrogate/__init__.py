"""What was learned: regression with error bars, query, stiffness maps, VTK."""

from surrogate.model import ErrorFigures, QueryResult, Surrogate, predict_compliance, query
from surrogate.storage import load_surrogate, save_surrogate
from surrogate.sweep import default_sweep, sweep_map
from surrogate.training import Trained, full_poses, run_model, scope_of, train
from surrogate.vtk_files import StiffnessMap, read_vtu, write_vtu

__all__ = [
    "ErrorFigures",
    "QueryResult",
    "StiffnessMap",
    "Surrogate",
    "Trained",
    "default_sweep",
    "full_poses",
    "load_surrogate",
    "predict_compliance",
    "query",
    "read_vtu",
    "run_model",
    "save_surrogate",
    "scope_of",
    "sweep_map",
    "train",
    "write_vtu",
]
