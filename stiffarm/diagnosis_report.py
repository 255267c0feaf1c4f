from stiffarm.diagnosing import Diagnosed
from stiffarm.outputs import OutputFolder


def write_report(d: Diagnosed, folder: OutputFolder) -> None:
    pass
