"""How long `stiffarm serve` takes to answer, against a process a point and against a numerical inverse kinematics.

``python benchmarks/shop/serve_speed.py`` prints a table; ``--write`` puts it into docs/performance/service.md.
``--docs`` asks the examples of docs/reference/serve.md again and writes their answers there. Latencies are those of a
client: write a line to a pipe, wait for the answer, both processes on one machine. OMP_NUM_THREADS=1.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from robots.arrays import Array

ROOT = Path(__file__).resolve().parents[2]
CELL = ROOT / "docs" / "examples" / "serve" / "cell.toml"
PAGE = ROOT / "docs" / "reference" / "serve.md"
SPEED = ROOT / "docs" / "performance" / "service.md"
# Points along a line on the part, gamma kept: what a postprocessor asks one after the other.
GAMMA = -45.0


class Client:
    """Asks a service and times it."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self.process = process

    def line(self, request: bytes) -> bytes:
        """The answer line to a request line."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(request + b"\n")
        self.process.stdin.flush()
        return self.process.stdout.readline()

    def ask(self, do: str, **keys: Any) -> tuple[Any, float]:
        """The answer, and the seconds that it took to come."""
        request = json.dumps({"id": 1, "do": do, **keys}).encode()
        start = time.perf_counter()
        line = self.line(request)
        seconds = time.perf_counter() - start
        answer = json.loads(line)
        assert answer["ok"], answer
        return answer, seconds


@contextmanager
def service(model: str = "kr60-3", cell: Path | None = CELL) -> Iterator[Client]:
    """A running service."""
    command = [sys.executable, "-m", "stiffarm", "serve", model, *(["--cell", str(cell)] if cell else [])]
    process = subprocess.Popen(  # noqa: S603 - our own interpreter
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=ROOT, env=environment()
    )
    try:
        yield Client(process)
    finally:
        assert process.stdin is not None
        process.stdin.close()
        process.wait(timeout=60)


def environment() -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}


def latencies(client: Client, n: int = 1000) -> dict[str, Array]:
    """Seconds (n,) a request, by what was asked."""
    up = {"tool_axis": [0, 0, 1]}
    found: dict[str, list[float]] = {}

    def timed(name: str, do: str, **keys: Any) -> Any:
        answer, seconds = client.ask(do, **keys)
        found.setdefault(name, []).append(seconds)
        return answer

    last = client.ask("ik", point_mm=[0, 0, 0], gamma_deg=GAMMA, **up)[0]["q_deg"]
    for i in range(n):
        point = [100.0 * i / n, 20.0 * np.sin(6.0 * i / n), 0.0]
        timed("ping", "ping")
        last = timed("ik, nearest", "ik", point_mm=point, gamma_deg=GAMMA, near_deg=last, **up)["q_deg"]
        timed("ik, stiffest", "ik", point_mm=point, gamma_deg=GAMMA, near_deg=last, which="stiffest", **up)
        timed("fk", "fk", q_deg=last)
        timed("stiffness along a direction", "stiffness", q_deg=last, direction=[0, 0, 1])
        timed("stiffness, k_fs", "stiffness", q_deg=last, direction=[0, 0, 1], indices="k_fs")
        timed("stiffness, all indices", "stiffness", q_deg=last, direction=[0, 0, 1], force_N=[1, 0, 2], indices="all")
        timed("deflection", "deflection", q_deg=last, force_N=[50, 0, -100])
        timed("clearance", "clearance", q_deg=last)
        if i % 20 == 0:
            timed("best_angle, grid", "best_angle", point_mm=point, refine=False, collisions=False, **up)
            timed("best_angle, refined", "best_angle", point_mm=point, collisions=False, **up)
            timed("best_angle, refined, collisions", "best_angle", point_mm=point, **up)
    return {name: np.array(seconds) for name, seconds in found.items()}


def block_times(client: Client, n: int = 1000) -> dict[str, float]:
    """Seconds of requests for many points."""
    x = np.linspace(0.0, 100.0, n)
    points = np.stack([x, 20.0 * np.sin(0.06 * x), np.zeros(n)], axis=1)
    last = client.ask("ik", point_mm=[0, 0, 0], tool_axis=[0, 0, 1], gamma_deg=GAMMA)[0]["q_deg"]
    single = {"do": "ik", "tool_axis": [0, 0, 1], "gamma_deg": GAMMA, "near_deg": last}
    requests = [{"point_mm": p, **single} for p in points.tolist()]
    path = {"points_mm": points.tolist(), "tool_axis": [0, 0, 1], "feed_mm_per_min": 1000}
    few = {"points_mm": points[:: n // 20].tolist(), "tool_axis": [0, 0, 1], "force_N": [50, 0, -100]}
    return {
        f"batch of {n} ik": client.ask("batch", requests=requests)[1],
        f"best_path, {n} points": client.ask("best_path", collisions=False, **path)[1],
        f"best_path, {n} points, collisions": client.ask("best_path", **path)[1],
        "best_base, 20 points, all gamma": client.ask("best_base", collisions=False, **few)[1],
    }


def process_a_point(runs: int = 3) -> float:
    """Seconds of a process that is asked for one pose: what calling a program at every point costs."""
    pose = "q1_deg=0,q2_deg=-60,q3_deg=30,q5_deg=30"
    command = [sys.executable, "-m", "stiffarm", "index", "kr60-3", "--pose", pose, "--json"]
    seconds = []
    for _ in range(runs):
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True, cwd=ROOT, env=environment())  # noqa: S603
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def pinocchio_loop(targets: Array, start: Array) -> tuple[Array, float] | None:
    """Seconds (n,) of damped least squares in this process from the last posture, and the share solved; None without.

    The loop of pinocchio's own example of inverse kinematics (Jacobian of the logarithm, damping 1e-12), with whole
    steps; each target is the flange's (n, 4, 4), ``start`` (6,) rad.
    """
    try:
        import pinocchio as pin
    except ImportError:
        return None
    from robots import load_robot

    robot = load_robot("kr60-3")
    model, before = pin.Model(), np.eye(4)
    for i in range(robot.dof):
        model.addJoint(i, pin.JointModelRZ(), pin.SE3(before @ robot.T_pre[i]), f"j{i + 1}")
        before = np.eye(4)
        before[:3, :3] = robot.R_post[i]
    frame = pin.Frame("flange", robot.dof, 0, pin.SE3(before @ robot.T_last_flange), pin.FrameType.OP_FRAME)
    flange, data = model.addFrame(frame), model.createData()
    theta, solved, seconds = robot.sign * start + robot.offset, 0, []
    for target in targets:
        begin = time.perf_counter()
        goal = pin.SE3(target)
        for _ in range(50):
            pin.framesForwardKinematics(model, data, theta)
            away = data.oMf[flange].actInv(goal)
            error = pin.log6(away).vector
            if np.linalg.norm(error) < 1e-9:
                solved += 1
                break
            J = -pin.Jlog6(away.inverse()) @ pin.computeFrameJacobian(model, data, theta, flange)
            theta = theta - J.T @ np.linalg.solve(J @ J.T + 1e-12 * np.eye(6), error)
        seconds.append(time.perf_counter() - begin)
    return np.array(seconds), solved / len(targets)


def flange_targets(n: int = 1000) -> tuple[Array, Array]:
    """The flange's targets (n, 4, 4) of the points that the service is asked, and a posture to start from."""
    from machining import Task, tool_path
    from machining.cell import read_cell
    from robots import inverse_kinematics, load_robot

    cell, i = read_cell(CELL), np.arange(n)
    points = np.stack([100.0 * i / n, 20.0 * np.sin(6.0 * i / n), np.zeros(n)], axis=1) * 1e-3
    T_tool, T_part = cell.tool.T_flange_tool, cell.T_base_part()[0]
    task = Task(tool_path(points, [0.0, 0.0, 1.0]), T_tool, T_part, np.array([1.0, 0.0, 0.0]))
    tool = task.tool_frames([np.radians(GAMMA)])[:, 0]
    flange = tool @ np.linalg.inv(T_tool)
    found = inverse_kinematics(load_robot("kr60-3"), flange[:1], T_flange_tool=np.eye(4))
    return flange, found.q[0, int(np.argmax(found.valid[0]))]


def page(n: int = 1000) -> str:
    """The page of docs/performance/service.md."""
    with service() as client:
        single, blocks = latencies(client, n), block_times(client, n)
    alone, numerical = process_a_point(), pinocchio_loop(*flange_targets(n))
    lines = [
        "# How long `stiffarm serve` takes",
        "",
        "<!-- figures from: docs/performance/service.md -->",
        "A question about one pose is answered in 0.4 to 1.6 ms (median), the best angle about the tool axis",
        "in 3 ms on a grid and in 18 ms refined. Starting a process for each point takes a thousand times as long.",
        "",
        "Written by `python benchmarks/shop/serve_speed.py --write`: KUKA KR60-3 with beam links, the cell of",
        "[examples/serve](../examples/serve/README.md), one client that waits for each answer, over pipes. Both",
        f"processes share {os.cpu_count()} processor(s) with other work, which causes the slowest answers. {n}",
        f"requests each (best_angle {n // 20}); ms.",
        "",
        "| request | p50 | p99 | fastest |",
        "| --- | --- | --- | --- |",
    ]
    for name, seconds in single.items():
        p50, p99 = np.percentile(seconds, [50, 99]) * 1e3
        lines.append(f"| {name} | {p50:.2f} | {p99:.2f} | {seconds.min() * 1e3:.2f} |")
    lines += ["", "| block | s | ms a point |", "| --- | --- | --- |"]
    for name, took in blocks.items():
        points = 20 if " 20 " in name else n
        lines.append(f"| {name} | {took:.2f} | {took * 1e3 / points:.2f} |")
    stiff = float(np.median(single["stiffness, all indices"]))
    lines += [
        "",
        f"A process for each point (`stiffarm index --pose`, all indices of one pose) takes {alone:.2f} s, "
        f"{alone / stiff:.0f} times as long as asking for them.",
        "",
    ]
    if numerical is not None:
        seconds, share = numerical
        ratio = float(np.median(single["ik, nearest"])) / float(np.median(seconds))
        lines += [
            "Numerical inverse kinematics with pinocchio inside the asking process (no pipe, no JSON; damped least",
            f"squares from the last posture to 1e-9): p50 {np.percentile(seconds, 50) * 1e3:.2f} ms, p99 "
            f"{np.percentile(seconds, 99) * 1e3:.2f} ms, {100 * share:.0f} % solved;",
            f"`ik` over the pipe takes {ratio:.1f} times that. The loop finds one branch and keeps no limits; `ik`",
            "checks all eight and all turns within limits, and says why the others fail.",
            "",
        ]
    return "\n".join(lines)


def documented(text: str) -> list[tuple[str, str | None]]:
    """Requests of docs/reference/serve.md, each with the answer that follows it."""
    found: list[tuple[str, str | None]] = []
    for line in text.splitlines():
        if line.startswith("-> "):
            found.append((line[3:], None))
        elif line.startswith("<- "):
            found[-1] = (found[-1][0], line[3:])
    return found


def redocument() -> None:
    """Ask the examples of docs/reference/serve.md again and write their answers."""
    out: list[str] = []
    with service() as client:
        for line in PAGE.read_text(encoding="utf-8").splitlines():
            if line.startswith("<- "):
                continue
            out.append(line)
            if line.startswith("-> "):
                out.append("<- " + client.line(line[3:].encode()).decode().rstrip("\n"))
    PAGE.write_text("\n".join(out) + "\n", encoding="utf-8")


def main() -> None:
    if "--docs" in sys.argv:
        redocument()
        return
    text = page()
    print(text)
    if "--write" in sys.argv:
        SPEED.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
