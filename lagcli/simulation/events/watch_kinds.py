"""The functions that are watched along a step by what they are: numbers, directions, and events that are recorded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli.contact import zero_search
from lagcli.equations.system import System

DIRECTIONS = {"up": zero_search.UP, "down": zero_search.DOWN, "both": zero_search.BOTH}


class WatchKinds:
    """Of the functions w (W,) of `WatchFunctions`, of the contacts that are open, and of those that are held.

    numbers (W,): of their rows, and of events after all rows, from `first_event` on; direction (W,): as `zero_search`
    takes it; is_event (W,); records (W,): events that do not end the run; names: of events, by their place in w.
    """

    def __init__(self, system: System, open_: Sequence[int], held: Sequence[int]) -> None:
        C, events = len(system.rows.rows), system.model.events
        self.first_event, count = C + system.contacts.count, system.event_values.numel()
        self.has_events = count > 0
        contacts = [C + j for j in (*open_, *held)]
        self.numbers = np.array(
            [*contacts, *range(self.first_event, self.first_event + count)], dtype=np.intp
        )
        self.is_event = self.numbers >= self.first_event
        self.direction = np.full(self.numbers.size, zero_search.DOWN)
        self.records = np.zeros(self.numbers.size, dtype=bool)
        self.names: dict[int, str] = {}
        for place, event in enumerate(events[:count], start=len(contacts)):
            self.direction[place] = DIRECTIONS[event.direction]
            self.records[place] = event.action == "record"
            self.names[place] = event.name
