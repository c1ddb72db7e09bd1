"""Answers about one text, kept for the next who asks: `dof`, `check` and `simulate` of a model ask for the same start
and the same verdicts, and a search in vain takes seconds."""

from __future__ import annotations

import contextlib
from collections import OrderedDict
from collections.abc import Hashable, Iterator
from typing import TypeVar

from lagcli.errors import diagnostics

Answer = TypeVar("Answer")


class RecentAnswers:
    """The last few answers, refusals too, by the questions, which name all that their answers depend on."""

    MOST = 16  # that are kept: one after the other, three commands ask for less

    def __init__(self) -> None:
        self._known: OrderedDict[Hashable, object] = OrderedDict()

    def __contains__(self, question: Hashable) -> bool:
        return question in self._known

    def keep(self, question: Hashable, answer: object) -> None:
        """Take in an answer, and forget the one that was asked for longest ago where there are many."""
        self._known[question] = answer
        while len(self._known) > self.MOST:
            self._known.popitem(last=False)

    @contextlib.contextmanager
    def refusals(self, question: Hashable) -> Iterator[None]:
        """Inside the block a `diagnostics.ModelError` is the answer."""
        try:
            yield
        except diagnostics.ModelError as error:
            self.keep(question, diagnostics.ModelError(error.diagnostics))  # without the frames it came from
            raise

    def answer(self, question: Hashable, kind: type[Answer]) -> Answer:
        """The known answer to a question. Raises `diagnostics.ModelError` where that is one."""
        self._known.move_to_end(question)
        known = self._known[question]
        if isinstance(known, diagnostics.ModelError):
            raise diagnostics.ModelError(known.diagnostics)
        assert isinstance(known, kind)
        return known
