"""The gradient of a dense polynomial, degree 6 in each of two variables, by one library.

gradient.py LIBRARY FUNCTIONS POINTS OUT
FUNCTIONS is 1 if sin and exp are to be added. POINTS is a file of float64, all x before all y;
OUT is where the gradient goes, all dH/dx before all dH/dy.
"""

import os
import sys
import tempfile
import time

from peer import serve

import numpy as np

library, functions, points_path, out_path = sys.argv[1:]
functions = functions == "1"
points = np.fromfile(points_path).reshape(2, -1)


def energy(x, y, sin, exp):
    h = 0.0
    for k in range(1, 49):
        h = h + float(0.1 * np.sin(1.7 * k)) * x ** (k // 7) * y ** (k % 7)
    if functions:
        h = h + 0.3 * (sin(x) + exp(y) + sin(x * y))
    return h


def heyoka(fast):
    import heyoka as hy

    x, y = hy.make_vars("x", "y")
    h = hy.expression(energy(x, y, hy.sin, hy.exp))
    compiled = hy.cfunc([hy.diff(h, x), hy.diff(h, y)], vars=[x, y], fast_math=fast)
    out = np.zeros_like(points)

    def run():
        compiled(points, outputs=out)
        return out

    return run, hy.__version__


def jax():
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    of_one = jax.grad(lambda x, y: energy(x, y, jnp.sin, jnp.exp), (0, 1))
    compiled = jax.jit(jax.vmap(of_one))
    x, y = jnp.asarray(points[0]), jnp.asarray(points[1])
    compiled = compiled.lower(x, y).compile()

    def run():
        return [part.block_until_ready() for part in compiled(x, y)]

    return run, jax.__version__


def casadi(c_compiler):
    import casadi as ca

    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    h = energy(x, y, ca.sin, ca.exp)
    options = {}
    if c_compiler:
        flags = ["-O3", "-march=native"]
        options = {"jit": True, "compiler": "shell", "jit_options": {"flags": flags}}
    # What the compiler is given and gives back lies about where the process is.
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        one = ca.Function("g", [x, y], [ca.gradient(h, x), ca.gradient(h, y)], options)
        os.chdir(here)
    compiled = one.map(points.shape[1])
    row = [ca.DM(points[0]).T, ca.DM(points[1]).T]

    def run():
        return compiled(*row)

    return run, ca.__version__


def spent():
    """Processor time, that of compilers which were called included."""
    children = os.times()
    return time.process_time() + children.children_user + children.children_system


clock = spent()
if library == "heyoka":
    run, version = heyoka(False)
elif library == "heyoka-fast":
    run, version = heyoka(True)
elif library == "jax":
    run, version = jax()
elif library == "casadi":
    run, version = casadi(False)
else:
    run, version = casadi(True)
compile_seconds = spent() - clock

np.asarray([np.asarray(part).ravel() for part in run()]).tofile(out_path)


def repeat():
    clock = time.process_time()
    run()
    return {"seconds": time.process_time() - clock}


serve(repeat, compile=compile_seconds, version=version)
