"""Instants that ordinary steps do not lead over: an `Event` finds its instant in a step and goes on from there.

In: the step that was found, as a curve
Out: the instant, the state after it, and the incidents that are reported

`event` says what an event is asked, `events_of_run` which a run may meet. `contact_event` has one-sided constraints and
declared events, `singular_event` singular configurations, `switch_event` functions of t, `impulse_event` jumps of
potentials.
"""
