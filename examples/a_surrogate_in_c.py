"""Can a C program ask for the stiffness?
=========================================

The surrogate is written as one C99 header that needs only the standard library, for a
controller or a simulator. A small program evaluates it at many angles, and its answers
are compared with those of Python.
"""
# Needs: a C compiler

import subprocess
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import stiffarm as sa

surrogate = sa.fit(sa.load("kr60-3", links="rigid"), inputs=["q2_deg", "q3_deg"])
surrogate.save("stiffness.h")
program = """
#include "stiffness.h"
#include <stdio.h>
int main(void) {
    double q[2], compliance[1];
    while (scanf("%lf %lf", &q[0], &q[1]) == 2) {
        if (kr60_3_compliance_evaluate(q, compliance) == 0)
            printf("%.17g\\n", 1e-3 / compliance[0]);
    }
    return 0;
}
"""
Path("ask.c").write_text(program)
subprocess.run(["cc", "-std=c99", "ask.c", "-o", "ask", "-lm"], check=True)
angles = np.linspace(-120, -20, 200)
asked = "\n".join(f"{np.radians(q2):.17g} {np.radians(40):.17g}" for q2 in angles)
answered = subprocess.check_output("./ask", input=asked, text=True)
in_c = np.array(answered.split(), dtype=float)

in_python = surrogate.query([{"q2_deg": q2, "q3_deg": 40} for q2 in angles]).values
figure, ax = plt.subplots(layout="constrained")
ax.plot(angles, in_python, linewidth=6, alpha=0.3, label="Python")
ax.plot(angles, in_c, label="C")
ax.set(xlabel="q2 (deg)", ylabel="stiffness under a vertical load (N/mm)")
ax.legend()
# Picture: the stiffness over the angle of joint 2, asked in Python and in C. The two
# curves lie on each other.
figure.savefig("a_surrogate_in_c.png")

off = np.abs(in_c / in_python - 1).max()
print(f"Largest difference between C and Python: {100 * off:.0e} %")
assert len(in_c) == len(angles)
assert off < 1e-9

# %%
# Outside the range over which it was fitted, the function returns a status and no
# value, as in Python. The comment at the top of the header gives the ranges, the units
# and the errors on runs kept out of the fit.
#
# Read on: :doc:`/how-to/surrogate` (Python without imports, JavaScript, ONNX),
# :doc:`/performance/queries`.
