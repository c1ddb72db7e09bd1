"""The events that a run may meet: one is a file in this room, and its lines in `found`."""

from __future__ import annotations

from lagcli.simulation.events.event import Event
from lagcli.simulation.events.singular_event import SingularEvent
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.smoothness import named_functions


def found(stepper: Stepper) -> tuple[Event, ...]:
    """The events, in the order in which they are asked; the first that finds a step leaves none to the others. Modules
    that most runs have no use for are loaded where a run may meet what they are for."""
    enforced, events = stepper.bound.enforced, list[Event]()
    system, model = enforced.system, enforced.system.model
    if stepper.timetable.is_any:  # functions of t that switch
        from lagcli.simulation.events.switch_event import SwitchEvent

        events.append(SwitchEvent(stepper))
    events.append(SingularEvent(stepper))
    if (
        system.jumps is not None and system.jumps.crossings is not None
    ):  # of what the equations take for smooth
        from lagcli.simulation.events.impulse_event import ImpulseEvent

        events.append(ImpulseEvent(stepper, system.jumps.crossings))
    # Edges of conditions, and switches of forces at contacts.
    kinked = named_functions.switching_contacts(model)
    if kinked.any() or (kinked.size and named_functions.have_switching_forces(model)):
        from lagcli.simulation.events.contact_edges import EdgeEvent

        events.append(EdgeEvent(stepper))
    if system.contacts.count or system.event_values.numel():
        from lagcli.simulation.events.contact_event import ContactEvent

        events.append(ContactEvent(stepper))
    switches = enforced.plain.functions.numeric.force_switches
    if switches is not None:  # of forces in the velocities
        from lagcli.simulation.events.switch_event import StickingEvent

        events.append(StickingEvent(stepper, switches))
    return tuple(events)
