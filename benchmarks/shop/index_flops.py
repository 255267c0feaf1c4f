"""Operations of the compiled sweep, counted by running its source on numbers that count (numba's compiler off)."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections import Counter
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

# An arctangent in flops: a polynomial of degree 20 with its division.
ARCTANGENT = 25


class Number:
    """A float that counts what is done with it. Signs, comparisons and absolute values count nothing."""

    done: ClassVar[Counter[str]] = Counter()

    def __init__(self, value: float) -> None:
        self.value = float(value)

    def __float__(self) -> float:
        return self.value

    def __neg__(self) -> Number:
        return Number(-self.value)

    def __abs__(self) -> Number:
        return Number(abs(self.value))

    def __lt__(self, other: Any) -> bool:
        return self.value < float(other)

    def __le__(self, other: Any) -> bool:
        return self.value <= float(other)

    def __gt__(self, other: Any) -> bool:
        return self.value > float(other)

    def __ge__(self, other: Any) -> bool:
        return self.value >= float(other)

    def __eq__(self, other: object) -> bool:
        return self.value == float(other)  # type: ignore[arg-type]

    __hash__ = None  # type: ignore[assignment]

    def rint(self) -> Number:
        """To the nearest whole number."""
        return self._made("round", np.rint(self.value))

    def ceil(self) -> Number:
        """Up to a whole number."""
        return self._made("round", np.ceil(self.value))

    def sqrt(self) -> Number:
        """Square root."""
        return self._made("square root", math.sqrt(self.value))

    def _made(self, what: str, value: float) -> Number:
        Number.done[what] += 1
        return Number(value)


def _operation(what: str, forward: Any) -> tuple[Any, Any]:
    return (
        lambda self, other: self._made(what, forward(self.value, float(other))),
        lambda self, other: self._made(what, forward(float(other), self.value)),
    )


for _name, _what, _forward in (
    ("add", "add", lambda a, b: a + b),
    ("sub", "add", lambda a, b: a - b),
    ("mul", "multiply", lambda a, b: a * b),
    ("truediv", "divide", lambda a, b: a / b if b else math.nan),
):
    _own, _other = _operation(_what, _forward)
    setattr(Number, f"__{_name}__", _own)
    setattr(Number, f"__r{_name}__", _other)


def operations_of_target() -> dict[str, float]:
    """Mean operations for one target (eight branches) on the benchmark's grid; in a process without the compiler."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    found = subprocess.run([sys.executable, __file__], env=environment, capture_output=True, text=True, check=True)  # noqa: S603 - this file
    return dict(json.loads(found.stdout))


def flops(operations: dict[str, float]) -> float:
    """One for each operation, ``ARCTANGENT`` for an arctangent."""
    return sum(count * (ARCTANGENT if name == "arctangent" else 1) for name, count in operations.items())


def _count() -> dict[str, float]:
    from benchmarks.shop.index_speed import curved_task, rigid_arm
    from machining.stiffness import compiled as fast_index
    from machining.stiffness import kernels as fast_kernels
    from robots.inverse.spherical_wrist import spherical_wrist_arm

    model, task = rigid_arm(), curved_task(40)
    k = fast_kernels.BLOCK
    point, gamma = np.arange(k) % 40, np.linspace(-3.0, 3.0, k)
    arm, compliance = spherical_wrist_arm(model.robot), fast_index.axial_compliance(model)
    assert compliance is not None
    figures = fast_index._figures(fast_kernels, arm, model.robot, task, compliance)
    points = fast_index._points(arm, task, task.normals)
    counting = np.vectorize(Number, otypes=[object])
    work = np.zeros((fast_kernels.ROWS, k), dtype=object)
    work[fast_kernels.GAMMA], work[fast_kernels.GAMMA + 1] = counting(np.cos(gamma)), counting(np.sin(gamma))
    fast_kernels.math = SimpleNamespace(sqrt=lambda x: Number(float(x)).sqrt())  # type: ignore[attr-defined]
    fast_kernels.solve(figures, counting(points), point, False, work.ravel())
    pairs = work[: fast_kernels.COSINE].astype(float), work[fast_kernels.COSINE : fast_kernels.MOVED].astype(float)
    q, reason, value = np.zeros((k, 8, 6)), np.zeros((k, 8), dtype=np.int8), np.zeros((k, 8))
    fast_kernels.finish(figures, counting(np.arctan2(*pairs)), work.ravel(), q, reason, value)
    done = {name: count / k for name, count in Number.done.items()}
    return {**done, "arctangent": float(fast_kernels.COSINE)}


if __name__ == "__main__":
    json.dump(_count(), sys.stdout)
