"""Long work: Python's lock is free, progress is told, Ctrl-C ends it with the best so far."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import leverrier


def test_other_threads_run_while_it_works() -> None:
    spec = leverrier.open("examples/henon-heiles/fit.ham")
    counted = 0
    done = threading.Event()

    def count() -> None:
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0.001)

    other = threading.Thread(target=count)
    other.start()
    start = time.perf_counter()
    spec.fit(progress=False)
    elapsed = time.perf_counter() - start
    done.set()
    other.join()
    assert counted > 20 * elapsed


def test_two_fits_at_a_time_give_what_one_gives(oscillator, swing) -> None:
    t, X = swing
    wanted = oscillator.fit(X, t=t).model.to_dict()
    found: list[dict] = []
    work = [
        threading.Thread(target=lambda: found.append(oscillator.fit(X, t=t).model.to_dict()))
        for _ in range(3)
    ]
    for one in work:
        one.start()
    for one in work:
        one.join()
    assert found == [wanted] * 3


def test_progress_is_told_and_may_fail(pendulum) -> None:
    told: list[tuple[str, float]] = []
    pendulum.diagnose(progress=lambda stage, fraction: told.append((stage, fraction)))
    assert told and all(isinstance(stage, str) and 0.0 <= x <= 1.0 for stage, x in told)

    def failing(stage: str, fraction: float) -> None:
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        pendulum.diagnose(progress=failing)


def test_a_bar_is_shown_where_it_is_asked_for(pendulum, capsys) -> None:
    pytest.importorskip("tqdm")
    pendulum.diagnose(progress=True)
    assert "%" in capsys.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="signals of Windows are others")
def test_ctrl_c_gives_the_best_so_far() -> None:
    # Signals reach the main thread of a process of its own.
    program = """
        import os, signal, threading, time
        import numpy as np
        import leverrier

        random = np.random.default_rng(0)
        spec = leverrier.parse('''
            coordinates q[1..2]; momenta p[1..2]
            param k = 1 in 0.5..2
            T = (p[1]^2 + p[2]^2)/2
            V = span{ poly(q; 8), cos(k*q[1]), cos(k*q[2]) }
        ''')
        t = np.arange(4000) * 0.05
        w = np.sqrt(2.0)
        X = np.column_stack([np.cos(t), np.cos(w*t), -np.sin(t), -w*np.sin(w*t)])
        X += 0.01 * random.standard_normal(X.shape)
        stages = []
        def progress(stage, fraction):
            stages.append(stage)
            if "segments" in stage:
                os.kill(os.getpid(), signal.SIGINT)
        start = time.monotonic()
        try:
            spec.fit(X, t=t, progress=progress)
        except KeyboardInterrupt as interrupt:
            best = getattr(interrupt, "best", None)
            print("interrupted", type(best).__name__, best.stop.reason if best else None)
        else:
            print("finished", stages)
    """
    found = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert found.stdout.split() == ["interrupted", "Law", "interrupted"], found


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_it_works_in_a_forked_process(oscillator, swing) -> None:
    t, X = swing
    wanted = oscillator.fit(X, t=t).coefficient("q^2")
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(write, repr(oscillator.fit(X, t=t).coefficient("q^2")).encode())
        os._exit(0)
    deadline = time.monotonic() + 120
    while os.waitpid(child, os.WNOHANG) == (0, 0):
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            pytest.fail("the fit in the child hangs")
        time.sleep(0.02)
    assert float(os.read(read, 100)) == wanted


def test_memory_of_numpy_is_left_as_it_was(oscillator, swing) -> None:
    t, X = swing
    X.flags.writeable = False
    before = X.copy()
    oscillator.fit(X, t=t)
    assert np.array_equal(X, before)
