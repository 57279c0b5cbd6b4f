"""Executors for tests: one whose work travels as to another process, one that draws nothing."""

import pickle
from concurrent.futures import Executor, Future


class Mailed(Executor):
    """Arguments and results are pickled on their way; `sent` lists the functions that were called."""

    def __init__(self):
        self.sent = []

    def submit(self, fn, /, *args, **kwargs):
        """The result of `fn`, which has seen copies of its arguments alone."""
        self.sent.append(fn.__name__)
        done = Future()
        work, given, named = pickle.loads(pickle.dumps((fn, args, kwargs)))
        done.set_result(pickle.loads(pickle.dumps(work(*given, **named))))
        return done


class Undrawn(Executor):
    """Returns an empty picture for each one that it is asked for: for tests of what a page says beside them."""

    def submit(self, fn, /, *args, **kwargs):
        done = Future()
        done.set_result("<svg></svg>")
        return done
