"""A worker without JAX whose questions are orders: the name of the stepper says what to do."""

from __future__ import annotations

import ctypes
import os
import time

import numpy as np
from pydantic import TypeAdapter

from ropeode.errors import InputError
from ropeode.laboratory import Answering, Loaded
from ropeode.laboratory import main as answer_questions
from ropeode.laboratory.messages import Ask, AskCheck, AskOrder, Order, OwnStepper, Phase, Refused

CODE = "from tests.laboratory.stand_in import main; main()"


class StandIn(Answering):
    def __init__(self, *ahead):
        self.prepared = ahead
        self.link = {}
        self.answered = 0
        self.version = None

    def answer(self, ask, progress):
        self.answered += 1
        asked = ask.stepper if isinstance(ask, AskOrder | AskCheck) else ""
        does, _, argument = asked.partition(" ")
        if does == "exit":
            os._exit(7)
        if does == "crash":
            ctypes.string_at(0)
        if does == "raise":
            raise InputError("stepper: raises given")
        if does == "break":
            raise ZeroDivisionError("by zero")
        if does == "spin":
            while True:
                pass
        if does == "eat":
            eaten = [b"x" * 2**24 for _ in range(int(argument))]
            time.sleep(20)
            del eaten
        if does == "wait":
            for _ in range(int(argument or 20) * 100):
                progress("waiting", 0.5)
                time.sleep(0.01)
        if does == "large":
            return Phase(every=self.answered, x_label="", v_label=""), {"x": np.ones(2**20)}
        words = f"answer {self.answered} of {os.getpid()}, version {self.version}"
        return order(words), {"x": np.arange(3.0)}

    def load(self, version, text, fault):
        if "exit" in text and fault is None:
            os._exit(7)
        self.version = version if fault is None else self.version
        own = OwnStepper(name="steps.py:step", version=self.version, fault=fault, line=None)
        return Loaded(own=(own,), files=())

    def ahead(self):
        return (TypeAdapter(Ask).validate_python(each) for each in self.prepared)

    def refusal(self, error):
        return Refused(message=str(error))


def order(words):
    return Order(
        stepper="",
        observed=None,
        low=None,
        high=None,
        verdict="",
        expected=None,
        words=words,
        used=(),
        left_out=(),
        constant=None,
    )


def main():
    answer_questions(StandIn)
