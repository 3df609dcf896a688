"""How a script talks to the program that compares: one line of JSON when it is ready, then one
for every line that it is sent."""

import json
import os
import sys

# One thread each, before any library is loaded.
for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = "1"
os.environ["XLA_FLAGS"] = (
    "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)


def say(**facts):
    print(json.dumps(facts), flush=True)


def serve(repeat, **ready):
    """Says what was prepared, then runs `repeat` as often as it is asked to."""
    say(**ready)
    for _ in sys.stdin:
        say(**repeat())
