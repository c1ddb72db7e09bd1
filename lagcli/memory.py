"""One memory of answers: what was computed before, kept for the next who asks.

An answer depends on its question alone, which names all that it is made of, and its kind where a memory has several.
So a memory may forget at any time: it is bounded, shared by threads, and `forget` empties all there are.
"""

from __future__ import annotations

import copy
import functools
import threading
import weakref
from collections.abc import Callable, Hashable
from typing import NamedTuple, ParamSpec, TypeVar, cast

Answer = TypeVar("Answer")
Arguments = ParamSpec("Arguments")

MOST = 128  # answers of one memory: the inner one of two loops over values comes again for each value of the outer


class Memory:
    """The answers that were asked for last, at most so many, by their questions."""

    __slots__ = ("__weakref__", "_answers", "_lock", "_most")

    def __init__(self, most: int = MOST) -> None:
        self._answers: dict[Hashable, object] = {}
        self._lock, self._most = threading.Lock(), most
        _emptied.add(self)

    def answer(
        self,
        question: Hashable,
        find: Callable[[], Answer],
        refusals: tuple[type[Exception], ...] = (),
    ) -> Answer:
        """The answer to a question, found if it is not known. An exception that is one of `refusals` is an answer too,
        and raised each time."""
        kept = self.known(question)
        if kept is None:
            try:
                kept = find()
            except refusals as error:
                self.keep(question, _Refusal(copy.copy(error)))
                raise
            self.keep(question, _NOTHING if kept is None else kept)
        if isinstance(kept, _Refusal):
            raise copy.copy(kept.error)  # to be raised once
        return cast("Answer", None if kept is _NOTHING else kept)

    def known(self, question: Hashable) -> object:
        """What is kept as the answer to a question, None where there is nothing."""
        with self._lock:
            kept = self._answers.pop(question, None)
            if kept is not None:
                self._answers[question] = kept  # last in line to be forgotten
            return kept

    def keep(self, question: Hashable, answer: object) -> None:
        """Take in an answer, and forget the one that was asked for longest ago where there are too many."""
        with self._lock:
            self._answers.pop(question, None)
            self._answers[question] = answer
            if len(self._answers) > self._most:
                del self._answers[next(iter(self._answers))]

    def clear(self) -> None:
        """Forget all answers."""
        with self._lock:
            self._answers.clear()


_NOTHING = object()  # the answer None
_emptied: weakref.WeakSet[Memory] = weakref.WeakSet()
_functions: list[Callable[[], None]] = []


class _Refusal(NamedTuple):
    """An exception as it was raised, without the frames it came from."""

    error: Exception


def remembered(
    most: int = MOST,
) -> Callable[[Callable[Arguments, Answer]], functools._lru_cache_wrapper[Answer]]:
    """Have a function remember its last answers: it must depend on its arguments alone."""

    def remembering(function: Callable[Arguments, Answer]) -> functools._lru_cache_wrapper[Answer]:
        made = functools.lru_cache(maxsize=most)(function)
        _functions.append(made.cache_clear)
        return made

    return remembering


def forget() -> None:
    """Empty all memories."""
    for clear in (*_functions, *(memory.clear for memory in tuple(_emptied))):
        clear()
