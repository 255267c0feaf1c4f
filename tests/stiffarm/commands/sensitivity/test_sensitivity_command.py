"""`sensitivity --method morris|sobol|derivative`: indices that exact derivatives confirm, over any numbers."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli_runs import Command, tree
from small_robot import STIFFNESS, write_readings, write_urdf

SPRINGS = tuple(f"{name}.stiffness" for name in STIFFNESS)
# Over ranges this narrow each effect is straight, so that shares are known exactly.
NARROW = ("--low", "4e5", "--high", "4.1e5")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a URDF and readings of three poses."""
    folder = tmp_path_factory.mktemp("small")
    write_readings(write_urdf(folder / "small.urdf"), folder / "readings.csv", 3, sideways=False)
    return folder


def _run(cli: Command, small: Path, *options: str) -> dict:  # type: ignore[type-arg]
    outcome = cli("sensitivity", small / "small.urdf", small / "readings.csv", *options, "--json")
    assert outcome.code == 0, outcome.err
    return outcome.json  # type: ignore[no-any-return]


def test_sobol_indices_are_the_squares_of_exact_derivatives(cli: Command, small: Path) -> None:
    result = _run(cli, small, "--method", "sobol", *NARROW)
    assert list(dict.fromkeys(row["pose"] for row in result["effects"])) == ["S0-0", "S0-1", "S0-2"]
    # Three springs: vertical loads do not turn the waist.
    assert result["runs"] == 512 * (3 + 2)
    for pose in {row["pose"] for row in result["effects"]}:
        shares = [row["derivative_share"] for row in result["effects"] if row["pose"] == pose]
        assert sum(shares) == pytest.approx(1.0, abs=1e-5)
    for row in result["effects"]:
        # Sampling: within twice the 95 % half-width; the curvature over 2.5 % adds less than 0.001.
        wide = 2.0 * row["total_conf95"] + 1e-3
        assert row["total"] == pytest.approx(row["derivative_variance_share"], abs=wide)


def test_morris_means_are_the_effects_of_the_factorial(cli: Command, small: Path) -> None:
    for e in _run(cli, small, *NARROW)["effects"]:
        # The factorial takes the component that was read largest at each pose.
        options = ("--method", "morris", "--poses", e["pose"], "--component", e["read"][1:])
        for row in _run(cli, small, *options, *NARROW)["effects"]:
            effect = abs(e[f"effect_{row['parameter'].removesuffix('.stiffness')}_mm"])
            # The slope by ln k changes by 2.5 % over the range, and six levels do not weigh it evenly.
            assert row["mean_effect_mm"] == pytest.approx(effect, rel=0.02, abs=1e-9)
            assert row["spread_mm"] < 0.02 * effect + 1e-9


def test_any_numbers_and_components(cli: Command, small: Path) -> None:
    free = "shoulder.stiffness,base.ry,tool.tz,elbow.zero,load.x"
    result = _run(cli, small, "--free", free, "--component", "ry", "--samples", "16", "--poses", "S0-1")
    assert result["method"] == "sobol"
    shares = {row["parameter"]: row["derivative_share"] for row in result["effects"]}
    assert list(shares) == free.split(",")
    ranges = {row.pop("parameter"): row for row in result["ranges"]}
    assert ranges["base.ry"] == {"low": 1e7, "high": 1e8, "unit": "N m/rad"}
    # A tool that gives way along z does not turn.
    assert shares["tool.tz"] == 0.0
    assert max(shares, key=shares.__getitem__) == "shoulder.stiffness"


def test_the_same_seed_gives_the_same(cli: Command, small: Path) -> None:
    options = ("--method", "sobol", "--samples", "32")
    assert _run(cli, small, *options, "--seed", "3") == _run(cli, small, *options, "--seed", "3")
    assert _run(cli, small, *options, "--seed", "3") != _run(cli, small, *options, "--seed", "4")


@pytest.mark.slow
@pytest.mark.parametrize("method", ["sobol", "morris", "derivative"])
def test_a_table_and_a_picture(cli: Command, small: Path, tmp_path: Path, method: str) -> None:
    outcome = cli("sensitivity", small / "small.urdf", small / "readings.csv", "--method", method, "--out", "out")
    assert (outcome.code, outcome.out) == (0, ""), outcome.err
    assert "shoulder.stiffness" in outcome.err
    files = {"sensitivity.json", "sensitivity.csv", "sensitivity.png", "run.json", "report.html", "shares.png"}
    files |= {"over_poses.csv", "ranges.csv"}
    assert set(tree(tmp_path / "out")) == files


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--method", "lasso"), ("--method: got 'lasso'", "factorial, morris, sobol, derivative")),
        (("--method", "factorial", "--free", SPRINGS[0]), ("--free: no option of --method factorial",)),
        (("--method", "morris", "--samples", "64"), ("--samples: no option of --method morris",)),
        (("--samples", "100"), ("samples of a Sobol study: got 100", "a power of two")),
        (("--component", "w"), ("--component: got 'w'", "x, y, z")),
        (("--free", "hip.stiffness"), ("'hip.stiffness'", "waist")),
        (("--free", SPRINGS[0], "--joints", "waist"), ("one of them at a time",)),
        (("--campaign", "nowhere.toml"), ("nowhere.toml",)),
    ],
)
def test_bad_options(
    cli: Command, small: Path, tmp_path: Path, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    outcome = cli("sensitivity", small / "small.urdf", small / "readings.csv", *options, "--out", "out")
    assert (outcome.code, outcome.out) == (2, ""), outcome.err
    for text in words:
        assert text in outcome.err
    assert tree(tmp_path) == {}
