"""Obligations in plain words, for a reader who does not know the proof."""

#: What each obligation says to an engineer.
PLAIN = {
    "plant": "the model feels every load and every number that the study states",
    "non-vacuity": "the statement is about something: the start lies inside the region, and no limit is zero",
    "reference": "the motion is smooth, ends at rest, and stays inside the stroke",
    "contraction": "what a start makes of the loop shrinks at least at this rate, computing delay included",
    "small gain": "what is uncertain of masses, drives and gains cannot feed itself by way of the loop",
    "conditions": "every state is stable by itself and strong enough against what the others do to it",
    "invariance": "nothing leaves the region in which the model was bounded, between the samples too",
    "authority": "no limit is passed: torque, current, voltage, speed, stroke",
    "adaptation": "the adaptive term cannot become negative at this rate, and no load network reaches its bound",
    "rounding": "gains as the controller stores them do the same",
    "accuracy": "the error bound is inside what the study requires",
    "guarantees": "each member keeps what it promises to the others",
    "motion": "the members move together",
    "loads": "what the members do to each other is inside what each was proved under",
    "coupling": "together the members have one well-defined motion",
    "output": "the error of the tool is inside what the study requires",
    "supply": "there is enough for all members of what they draw on together",
    "monitor": "nothing is shut down while all assumptions hold, as far as what is watched is measured",
}


def plain(name: str) -> str:
    """An obligation in plain words; empty for one that has none."""
    return PLAIN.get(name, "")
