"""The step `study`: every set through the diagnosis, blind, then scored by its key."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import get_context

from benchmarks.diagnosis.study.scores import Kind, Row
from benchmarks.diagnosis.study.sets import StudySet
from doe.diagnosis.hypotheses import is_learned
from fem.arm import Arm
from fem.effects.learned import axes_of, learned_place
from robots import InputError
from robots.progress import Progress, report_progress
from stiffarm.commands.diagnose import step as diagnosing
from stiffarm.commands.diagnose.command import DiagnoseRequest
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.session.inputs import read_model
from stiffarm.session.reading_checks import check_readings
from stiffarm.session.readings import read_data

NAN = float("nan")
# Workers are put out after so many sets each: what they have compiled stays, what they have hoarded goes. All at once:
# a pool that replaces them one by one (max_tasks_per_child) stood still for good after 200 sets.
TASKS = 100


def kind_of(one: StudySet, known: Sequence[str]) -> Kind:
    """Kind of a set, by the families of the catalogue as it now stands."""
    families = {code.partition(":")[0] for code in known}
    codes = [hidden.code for hidden in one.key.effects]
    if any(code.partition(":")[0] not in families for code in codes):
        return "outside"
    return "none" if not codes else "single" if len(codes) == 1 else "pair"


def run_set(one: StudySet) -> Row:
    """Diagnose one set, blind, and put what came of it beside its key."""
    start = time.perf_counter()
    try:
        given = read_model(one.model, one.file.links, one.file.load_path)
        found = diagnosed(one, given)
    except InputError as error:
        return row(one, None, "j1", seconds=time.perf_counter() - start, reason=error.prose)
    except Exception as error:
        fault = row(one, None, "j1", seconds=time.perf_counter() - start, reason=f"{type(error).__name__}: {error}")
        return replace(fault, verdict="failed")
    return row(one, found, given.robot.joint_names[0], seconds=time.perf_counter() - start)


def diagnosed(one: StudySet, given: Arm) -> Diagnosed:
    """The diagnosis of a set's readings, judged in its other set-ups."""
    unseen = None if one.unseen is None else read_data(given.robot, one.unseen)
    table = read_data(given.robot, one.readings)
    check_readings(given, table, confirm_units=False)
    return diagnosing.diagnose(given, table, DiagnoseRequest(next_poses=0, folds=0), holdout=unseen)


def row(one: StudySet, found: Diagnosed | None, first_joint: str, *, seconds: float, reason: str = "") -> Row:
    """What came of a set; ``found`` None: its readings were refused, for a ``reason``."""
    key = one.key
    excess = NAN if key.excess_chi2 is None else key.excess_chi2
    known = () if found is None else tuple(found.found.start.known)
    hidden = tuple(h.code for h in key.effects)
    truth = Row(
        one.name,
        kind_of(one, known or hidden),
        hidden,
        tuple(dict.fromkeys(axis for h in key.effects for axis in h.axis)),
        tuple(dict.fromkeys(h.place for h in key.effects if h.place)),
        excess,
        tuple(NAN if h.excess_chi2 is None else h.excess_chi2 for h in key.effects),
        key.tags,
        key.world,
        first_joint,
        reason=reason,
        seconds=seconds,
    )
    return truth if found is None else said(truth, found)


def said(truth: Row, d: Diagnosed) -> Row:
    """The row with what a diagnosis said."""
    f = d.found
    sure = tuple(one.code for one in f.effects) if f.verdict in ("named", "ambiguous") else ()
    all_found = tuple(one.code for one in d.in_model)
    probability = f.stated if d.in_model else f.ranking.best.probability
    laws = [one.code for one in f.found if is_learned(one.code)]
    if f.verdict == "unknown" and f.suspect is not None:
        laws.append(f.suspect.code)
    learned = tuple((axis, learned_place(code)) for code in dict.fromkeys(laws) for axis in axes_of(code))
    before, after = (NAN, NAN) if d.held_out is None else d.unseen_rms_mm
    return replace(
        truth,
        verdict=f.verdict,
        reason=f.reason,
        named=sure,
        found=all_found,
        probability=probability,
        set95=d.credible,
        learned=learned,
        not_testable=tuple(d.not_testable),
        before_mm=before,
        after_mm=after,
    )


def study(sets: Sequence[StudySet], jobs: int, progress: Progress | None = None) -> list[Row]:
    """All sets, in their order; ``jobs`` at a time."""
    if jobs == 1 or len(sets) == 1:
        out = []
        for k, one in enumerate(sets, start=1):
            out.append(run_set(one))
            report_progress(progress, k, len(sets))
        return out
    # Workers share the processors: one thread each.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    rows: dict[str, Row] = {}
    for done in rows_of(sets, min(jobs, len(sets))):
        rows[done.name] = done
        report_progress(progress, len(rows), len(sets))
    return [rows[one.name] for one in sets]


def rows_of(sets: Sequence[StudySet], jobs: int, each: int = TASKS) -> Iterator[Row]:
    """Rows of all sets as they are done, ``jobs`` at a time; workers are new after ``each`` sets a worker."""
    for start in range(0, len(sets), each * jobs):
        with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
            asked = [pool.submit(run_set, one) for one in sets[start : start + each * jobs]]
            try:
                for done in as_completed(asked):
                    yield done.result()
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
