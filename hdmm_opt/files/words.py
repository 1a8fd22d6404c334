"""Obligations in plain words, for a reader who does not know the proof."""

#: What each obligation says to an engineer.
PLAIN = {
    "plant": "the model feels every load and every number that the study states",
    "non-vacuity": "the statement is about something: the start lies inside the region, and no limit is zero",
    "reference": "the motion is smooth, ends at rest, and stays inside the stroke",
    "contraction": "from one sample to the next, errors shrink at least at this rate, whatever the masses are",
    "composition": "errors shrink at least at this rate under a controller that runs without samples",
    "conditions": "every state is stable by itself and strong enough against what the others do to it",
    "invariance": "nothing leaves the region in which the model was bounded, between the samples too",
    "authority": "no limit is passed: torque, current, voltage, speed, stroke",
    "sampling": "the control rate is fast enough",
    "adaptation": "the adaptive term cannot become negative at this rate",
    "rounding": "gains as the controller stores them do the same",
    "accuracy": "the error bound is inside what the study requires",
    "guarantees": "each member keeps what it promises to the others",
    "motion": "the members move together",
    "loads": "what the members do to each other is inside what each was proved under",
    "coupling": "together the members have one well-defined motion",
    "output": "the error of the tool is inside what the study requires",
    "observer": "the estimated speeds are good enough",
}


def plain(name: str) -> str:
    """An obligation in plain words; empty for one that has none."""
    return PLAIN.get(name, "")
