"""What a user is told of imported links: shells far softer than beams, poor angles, departures; links that are none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from cli_runs import Command
from urdf_arms import Arm

from fem import build_model
from robots import load_description
from stiffarm.commands.importing.gate import TipCompliance, tip_compliances
from stiffarm.commands.importing.results import warnings_of
from stiffarm.commands.simulate import pose as simulation


@pytest.mark.parametrize("ratio", [1.0, 2.99, 1 / 2.99])
def test_shells_as_soft_as_their_beams_or_nearly_need_no_word(ratio: float) -> None:
    assert TipCompliance(ratio * 1e-8, 1e-8).warning() is None


def test_shell_and_beam_that_differ_by_more_than_three_are_a_warning() -> None:
    soft = TipCompliance(4e-8, 1e-8).warning()
    assert soft is not None
    assert soft.startswith("WARNING: its tip is 4 times as compliant as a shell (40 um/kN) than as a beam (10 um/kN)")
    stiff = TipCompliance(1e-8, 5e-8).warning()
    assert stiff is not None
    assert "5 times as compliant as a beam (50 um/kN) than as a shell (10 um/kN)" in stiff
    assert "inf times" in str(TipCompliance(1e-8, 0.0).warning())


def test_compliances_are_those_of_the_condensed_links_and_come_after_the_departure() -> None:
    given = load_description("tx200")
    (link,) = [one.name for one in given.link if one.body == "j3"]
    found = tip_compliances(given, (link,))
    assert set(found) == {link}
    (beam,) = [part for part in build_model(given, "beam").links if part.name == link]
    # The forearm is held at root and tip alone; a force along each axis gives at most the largest eigenvalue.
    largest = float(np.linalg.eigvalsh(beam.element.flexibility[:3, :3])[-1])
    assert found[link].beam == pytest.approx(largest, rel=1e-9)
    # A parametric casing with rigid rings bends as its beam does, give or take its shear lag.
    assert 0.5 < found[link].ratio < 2.0
    link = SimpleNamespace(report=("scale", "WARNING: off by 60 mm"))
    said = SimpleNamespace(link=link, verdict=SimpleNamespace(warnings=("WARNING: gate",)))
    assert warnings_of(said, TipCompliance(4.0, 1.0))[:2] == ["WARNING: off by 60 mm", "WARNING: gate"]
    assert len(warnings_of(said, TipCompliance(4.0, 1.0))) == 3


def test_a_bare_urdf_is_said_to_have_no_links(cli: Command, tmp_path) -> None:
    urdf = Arm().write(tmp_path / "arm")
    outcome = cli("simulate", urdf, "--pose", "j2_deg=30", "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.json["links"] == simulation.NO_LINKS == "no links described: all bodies rigid"
    shown = cli("simulate", urdf, "--pose", "j2_deg=30")
    assert "note: no links described: all bodies rigid" in shown.err + shown.out
