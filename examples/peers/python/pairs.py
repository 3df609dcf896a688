"""Pairs of states to learn from, and predictions to be judged by.

Files are CSV with one line of names: q1, q2, p1, p2 before and after 0.1 in each row of pairs,
one state in each row of starts. The first 200 starts are predicted one step ahead, the others
80 steps ahead.
"""

import numpy as np

STEP, SHORT, LONG = 0.1, 200, 80


def read(path):
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return table[:, :4], table[:, 4:]


def predict(path, ahead, out):
    """`ahead(states)` moves many states 0.1 on. One row a start: the state after 0.1, or
    those after 0.1, 0.2, ... 8; NaN where the prediction broke down."""
    starts = np.loadtxt(path, delimiter=",", skiprows=1)
    rows = [list(row) for row in ahead(starts[:SHORT])]
    states, path_of = starts[SHORT:], []
    for _ in range(LONG):
        states = np.asarray(ahead(states), dtype=float)
        path_of.append(states)
    rows += [list(row) for row in np.stack(path_of, axis=1).reshape(len(states), -1)]
    with open(out, "w") as file:
        for row in rows:
            file.write(",".join(repr(float(x)) for x in row) + "\n")
