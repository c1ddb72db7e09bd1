"""The events that a run may meet: one is a file in this room, and its line in `EVENTS`."""

from __future__ import annotations

from collections.abc import Callable

from lagcli.simulation.events.event import Event
from lagcli.simulation.events.singular_event import SingularEvent
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.smoothness import named_functions

# Modules that most runs have no use for are loaded where a run may meet what they are for.


def _switches(stepper: Stepper) -> Event | None:
    """Functions of t that switch."""
    if not stepper.timetable.is_any:
        return None
    from lagcli.simulation.events.switch_event import SwitchEvent

    return SwitchEvent(stepper)


def _impulses(stepper: Stepper) -> Event | None:
    """Jumps of what the equations take for smooth."""
    jumps = stepper.bound.enforced.system.jumps
    if jumps is None or jumps.crossings is None:
        return None
    from lagcli.simulation.events.impulse_event import ImpulseEvent

    return ImpulseEvent(stepper, jumps.crossings)


def _edges(stepper: Stepper) -> Event | None:
    """Edges of conditions, and switches of forces at contacts."""
    model = stepper.bound.enforced.system.model
    kinked = named_functions.switching_contacts(model)
    if not (kinked.any() or (kinked.size and named_functions.have_switching_forces(model))):
        return None
    from lagcli.simulation.events.contact_edges import EdgeEvent

    return EdgeEvent(stepper)


def _contacts(stepper: Stepper) -> Event | None:
    """One-sided constraints and declared events."""
    system = stepper.bound.enforced.system
    if not (system.contacts.count or system.event_values.numel()):
        return None
    from lagcli.simulation.events.contact_event import ContactEvent

    return ContactEvent(stepper)


def _sticking(stepper: Stepper) -> Event | None:
    """Forces that switch in the velocities."""
    switches = stepper.bound.enforced.plain.functions.numeric.force_switches
    if switches is None:
        return None
    from lagcli.simulation.events.sticking_event import StickingEvent

    return StickingEvent(stepper, switches)


# In the order in which they are asked; the first that finds a step leaves none to the others.
EVENTS: tuple[Callable[[Stepper], Event | None], ...] = (
    _switches,
    SingularEvent,
    _impulses,
    _edges,
    _contacts,
    _sticking,
)


def found(stepper: Stepper) -> tuple[Event, ...]:
    """The events that a run may meet."""
    events = (of(stepper) for of in EVENTS)
    return tuple(event for event in events if event is not None)
