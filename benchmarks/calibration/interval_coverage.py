"""Do 95 % intervals hold the truth 95 % of the time? Calibrations of made-up readings with known parameters.

    python benchmarks/calibration/interval_coverage.py [--repeats 200] [--case NAME] [--robot NAME] [--json]
                                           [--write docs/validation/calibration_coverage.md]

Every repeat draws parameters, poses, load directions and noise anew, estimates parameters and noise, and looks
whether each interval holds what was drawn; ``coverage_cases.py`` has the cases.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from coverage_cases import CASES, ROBOTS, STATUSES, WHITE, Case, standard_error, study

from doe.estimation.noise import FEWEST_POSES

# The section on `calibrate` itself: command_coverage.py made its figures.
COMMAND = Path(__file__).with_name("command_coverage_page.md")
HEADING = """# Coverage of calibration intervals

<!-- figures from: docs/validation/calibration_coverage.md -->
The estimator's 95 % intervals, with the noise estimated together with the scatter between set-ups, contain the true
value in 92 to 97 % of the estimator's cases below (standard errors of 0.4 to 0.9 %), and the estimates have hardly any
bias. If set-ups scatter and the noise model leaves this out, they contain it in only 14 to 18 %; if that scatter is
treated as white noise, in 56 to 61 %. All readings are simulated; real ones also contain errors of the model.

{command}## What the estimator covers

Written by `python benchmarks/calibration/interval_coverage.py --repeats {repeats} --write
docs/validation/calibration_coverage.md`.

The calibrations use simulated readings whose parameters are known, and count how often the 95 % intervals contain them.
Every repeat draws new parameters, poses, load directions and noise. Springs about the joint axes are drawn log-uniform
from 1e5 to 3e6 N m/rad, tilting stiffnesses from 5e5 to 5e6 N m/rad, translations of joints from 3e7 to 1e9 N/m,
zero offsets with a standard deviation of 0.5 deg. Noise and parameters are estimated together, from a start that
knows neither, except where the table states the noise that was assumed. White noise is {white:.0f} um and
{turn:.0f} urad.

*Coverage*: share of the intervals that contain the true value, with its binomial standard error; parameters that are
"not identified" have no interval. An interval with an open end counts like any other. *Bias*: mean error in standard
deviations of the estimate. *Time*: of one fit with intervals, one thread, median.

| robot | case | intervals | coverage, % | bias, sd | determined, % | one-sided | at bound | not identified | time, ms |
|---|---|---|---|---|---|---|---|---|---|
"""


def table(results: list[tuple[str, Case, dict[str, float]]], repeats: int) -> str:
    """The page: what was done, the table, what the cases are, what to know about them."""
    command = COMMAND.read_text(encoding="utf-8")
    out = [HEADING.format(command=command, repeats=repeats, white=1e6 * WHITE.white[0], turn=1e6 * WHITE.white[1])]
    for robot, case, r in results:
        shares = " | ".join(f"{100.0 * r[s]:.0f}" for s in STATUSES)
        out.append(
            f"| {robot} | {case.name} | {r['intervals']:.0f} | {100.0 * r['coverage']:.1f} +- "
            f"{100.0 * r['standard_error']:.1f} | {r['bias_sd']:+.2f} | {shares} | {r['ms_per_fit']:.0f} |\n"
        )
    out.append("\nThe cases:\n\n")
    for case in {case.name: case for _, case, _ in results}.values():
        out.append(f"- **{case.name}**: {case.words}.\n")
    for robot, case, r in results:
        if r["combinations"]:
            share, n = r["coverage_of_combinations"], int(r["combinations"])
            out.append(
                f"\nOf the {len(case.names)} stiffnesses ({robot}) most are seen only in combination; "
                f"{n / repeats:.0f} combinations of them are determined in every repeat, and their intervals "
                f"contain the true value in {100.0 * share:.1f} +- {100.0 * standard_error(share, n):.1f} %.\n"
            )
    return "".join([*out, NOTES.format(fewest=FEWEST_POSES)])


NOTES = """
What to know about them:

- **The noise model must include the scatter between set-ups.** If set-ups scatter by 3 % and the noise is assumed to
  be the gauge's alone, about 15 % of the intervals contain the true value. White noise as large as all scatter
  together does not help: about 60 %. Six readings of one set-up share its error, so they are not six independent
  readings. `calibrate` estimates this scatter if there are {fewest} poses with several readings of one component
  each, and says how much narrower the intervals would be without it. If the readings cannot determine it, `calibrate`
  says so.
- **Outliers.** With robust weights the intervals are right and stay narrow. At full weight they are right too, because
  outliers as evenly spread as these count as more noise, but they are wider: fewer parameters have both limits.
- **Nine readings** of four springs leave five degrees of freedom. The search for outliers costs a little there: among
  so few, a good reading at two or three standard deviations is sometimes taken for an outlier, and the estimated
  noise is then too small. Over 400 repeats the case gives 93.9 to 94.9 +- 0.6 %, with `--no-robust` 94.8 to 95.2 +-
  0.6 %; the rest is chance, because the intervals of one repeat share its noise.
- **Nine set-ups** are above 95 %, because a variance estimated as zero still counts as uncertain: with so few set-ups,
  readings can hardly show which kind of scatter there is (`doe/certainty/uncertainty.py`).
- **Open ends and bounds.** Stiffnesses cannot be negative, and an interval that is open towards rigid is certain to
  contain a very stiff joint; cases with many of them lie above 95 %.
- **All six stiffnesses of every joint.** Loads at one end of the arm turn its joints in similar ways, so most of the
  36 stiffnesses are seen only in combination. They are not identified and have no interval; the combinations are
  identified, and their intervals are counted below the cases.
- **Laws and zeros** are not linear: their intervals come from the profile likelihood, which takes most of the time.
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--case", action="append", choices=[case.name for case in CASES], help="only these cases")
    parser.add_argument("--robot", action="append", choices=ROBOTS, help="only these robots")
    parser.add_argument("--write", type=Path, help="page to write")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    arguments = parser.parse_args()
    results = []
    for case in CASES:
        for robot in case.robots:
            if (arguments.case and case.name not in arguments.case) or (
                arguments.robot and robot not in arguments.robot
            ):
                continue
            r = study(robot, case, arguments.repeats).row()
            results.append((robot, case, r))
            sys.stderr.write(
                f"{robot:8} {case.name:18} {100.0 * r['coverage']:5.1f} +- {100.0 * r['standard_error']:.1f} %\n"
            )
    if arguments.json:
        rows = [{"robot": robot, "case": case.name, **r} for robot, case, r in results]
        json.dump({"repeats": arguments.repeats, "rows": rows}, sys.stdout, indent=2)
        sys.stdout.write("\n")
    page = table(results, arguments.repeats)
    if arguments.write:
        arguments.write.write_text(page)
    elif not arguments.json:
        sys.stdout.write(page)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
