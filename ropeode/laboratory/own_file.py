"""The user's file in the worker: each version is run, and the last one that works is kept."""

from __future__ import annotations

import dataclasses
import importlib
import linecache
import sys
import sysconfig
from pathlib import Path

from ropeode.errors import RopeodeError
from ropeode.laboratory.messages import OwnStepper
from ropeode.laboratory.replies import in_words, line_of, places_of
from ropeode.laboratory.setup import Own
from ropeode.laboratory.watch import watched_path
from ropeode.laboratory.wire import Loaded
from ropeode.steppers import steppers_in_text

_PATHS = sysconfig.get_paths()
# Whatever lies here is no file of the user's.
_LIBRARIES = (
    *(str(Path(_PATHS[name]).resolve()) for name in ("stdlib", "purelib", "platlib")),
    str(Path(__file__).resolve().parents[1]),
)


class OwnFile:
    """A file of steppers.

    Arguments:
        where: ``FILE.py:NAME`` for one of them, or ``FILE.py`` for all.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self.path = watched_path(where)
        self._imported: dict[str, str] = {}
        nothing = OwnStepper(name=where, version=None, fault=None, line=None)
        self.own = {where: Own(nothing, None)}

    def load(self, version: str, text: str, fault: str | None) -> Loaded:
        """Run a version of the file.

        Arguments:
            version: its name.
            text: of the file.
            fault: why it must not be run; None where nothing is known against it.
        """
        line, files = None, set()
        if fault is None:
            try:
                steppers = self._run(text)
            except RopeodeError as error:
                fault, line = in_words(error), line_of(error, self.path)
                files = {each for each, _ in places_of(error) if self._is_own(each)}
            else:
                self.own = {
                    name: Own(OwnStepper(name=name, version=version, fault=None, line=None), each)
                    for name, each in steppers.items()
                }
        if fault is not None:
            change = {"fault": fault, "line": line}
            self.own = {
                name: dataclasses.replace(each, facts=each.facts.model_copy(update=change))
                for name, each in self.own.items()
            }
        facts = tuple(each.facts for each in self.own.values())
        return Loaded(own=facts, files=tuple(files | {*self._imported.values()}))

    def _run(self, text: str) -> dict:
        # What it imports may have changed too.
        for name in self._imported:
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        linecache.checkcache()
        before = {*sys.modules}
        try:
            return steppers_in_text(self._where, text)
        finally:
            self._imported = {
                name: file
                for name, module in list(sys.modules.items())
                if name not in before
                and (file := getattr(module, "__file__", None))
                and self._is_own(file)
            }

    def _is_own(self, file: str) -> bool:
        """Whether it is another file of the user's."""
        path = Path(file).resolve()
        is_other = path.is_file() and path != self.path.resolve()
        return is_other and not str(path).startswith(_LIBRARIES)
