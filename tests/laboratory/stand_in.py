"""A worker without JAX whose questions are orders: the name of the stepper says what to do.

Its answers are phase planes that say how many questions this process has begun, which process it
is, and which version of the file it has.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import time

import numpy as np
from pydantic import TypeAdapter

from ropeode import sandbox
from ropeode.errors import InputError
from ropeode.laboratory import Answering, Loaded
from ropeode.laboratory.messages import Ask, OwnStepper, Phase


class StandIn(Answering):
    def __init__(self, *ahead):
        self.prepared = ahead
        self.link, self.path = {}, None
        self.answered = 0
        self.version = None

    def answer(self, ask, progress):
        self.answered += 1
        does, _, argument = getattr(ask, "stepper", "").partition(" ")
        if does == "exit":
            os._exit(7)
        if does == "crash":
            ctypes.string_at(0)
        if does == "raise":
            raise InputError("stepper: raises given")
        if does == "break":
            raise ZeroDivisionError("by zero")
        if does == "spit":
            # Whatever it finds: a whole message that is none, and bytes.
            sandbox.say(argument.encode())
            for n in range(3, 99):
                with contextlib.suppress(OSError):
                    os.write(n, b"[1]\n{")
        while does in ("spin", "eat"):
            self.eaten = b"x" * (2**29 if does == "eat" else 0)
        for _ in range(int(argument or 20) * 100 if does == "wait" else 0):
            progress("waiting", 0.5)
            time.sleep(0.01)
        found = Phase(every=self.answered, x_label=str(os.getpid()), v_label=str(self.version))
        return found, {"x": np.ones(2**20 if does == "large" else 3)}

    def load(self, version, text, fault):
        if "exit" in text and fault is None:
            os._exit(7)
        self.version = version if fault is None else self.version
        own = OwnStepper(name="steps.py:step", version=self.version, fault=fault, line=None)
        return Loaded(own=(own,), files=())

    def ahead(self):
        return (TypeAdapter(Ask).validate_python(each) for each in self.prepared)
