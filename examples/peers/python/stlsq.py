"""PySINDy's sequentially thresholded least squares.

stlsq.py PAIRS STARTS OUT DEGREE

Derivatives are differences over each pair, taken at its middle: of second order, the best that
a pair alone gives. Polynomials up to a total degree: those of the rates of Hénon-Heiles.
"""

import sys
import time
import warnings

from peer import serve

import numpy as np
import pysindy as ps

import pairs

warnings.filterwarnings("ignore")
pairs_path, starts_path, out, degree = sys.argv[1:]
before, after = pairs.read(pairs_path)
middle, rate = (before + after) / 2, (after - before) / pairs.STEP
# Smallest coefficient that is kept; the smallest true one is 1.
THRESHOLD = 0.3


def fit():
    model = ps.SINDy(
        optimizer=ps.STLSQ(threshold=THRESHOLD),
        feature_library=ps.PolynomialLibrary(degree=int(degree), include_bias=False),
    )
    clock = time.process_time()
    model.fit(middle, t=pairs.STEP, x_dot=rate)
    return model, time.process_time() - clock


def truth(names):
    """dq/dt = p, dp/dt = -dV/dq of Hénon-Heiles."""
    rows = [{"x2": 1.0}, {"x3": 1.0}, {"x0": -1.0, "x0 x1": -2.0}]
    rows.append({"x1": -1.0, "x0^2": -1.0, "x1^2": 1.0})
    return np.array([[row.get(name, 0.0) for name in names] for row in rows])


model, _ = fit()
found = model.coefficients()
true = truth(model.get_feature_names())


def ahead(states):
    """Twenty steps of the classical Runge-Kutta method: far below the model's error."""
    h = pairs.STEP / 20
    with np.errstate(all="ignore"):
        for _ in range(20):
            states = np.clip(states, -1e6, 1e6)
            a = model.predict(states)
            b = model.predict(states + h / 2 * a)
            c = model.predict(states + h / 2 * b)
            d = model.predict(states + h * c)
            states = states + h / 6 * (a + 2 * b + 2 * c + d)
    return states


pairs.predict(starts_path, ahead, out)
serve(
    lambda: {"seconds": fit()[1]},
    version=ps.__version__,
    error=float(np.abs(found - true).max()),
    exact=bool(((found != 0) == (true != 0)).all()),
    parameters=int((found != 0).sum()),
)
