"""One trajectory of Hénon-Heiles by heyoka's adaptive Taylor integrator.

taylor.py END SAMPLES TOLERANCE, then starts as lines of four numbers separated by commas.
Each start is followed to END; energies are taken at SAMPLES equal times. 0 as TOLERANCE is
heyoka's default, the rounding of a double.
"""

import sys
import time

from peer import say

import heyoka as hy
import numpy as np

end, samples, tolerance = float(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
x, y, u, v = hy.make_vars("x", "y", "u", "v")
equations = [(x, u), (y, v), (u, -x - 2.0 * x * y), (v, -y - x * x + y * y)]
clock = time.process_time()
integrator = hy.taylor_adaptive(equations, [0.1, 0.2, 0.35, 0.1], tol=tolerance)
say(compile=time.process_time() - clock, version=hy.__version__, order=integrator.order)


def energy(z):
    x, y, u, v = z
    return 0.5 * (u * u + v * v + x * x + y * y) + x * x * y - y * y * y / 3.0


for line in sys.stdin:
    start = [float(word) for word in line.split(",")]
    integrator.time = 0.0
    integrator.state[:] = start
    strayed, steps, spent = [], 0, 0.0
    for k in range(1, samples + 1):
        clock = time.process_time()
        outcome = integrator.propagate_until(end * k / samples)
        spent += time.process_time() - clock
        steps += int(outcome[3])
        strayed.append(energy(integrator.state) / energy(start) - 1.0)
    rms = float(np.sqrt(np.mean(np.square(strayed))))
    say(seconds=spent, error=rms, steps=steps, state=list(map(float, integrator.state)))
