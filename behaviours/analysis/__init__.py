"""Ask behaviours about themselves: how far apart, which one, from where on, and why."""

from behaviours.analysis.distance import distance, distances
from behaviours.analysis.explaining import Change, Explanation, explain
from behaviours.analysis.interpolation import switching_weight, switching_weights
from behaviours.analysis.recognition import Recognition, recognise
from behaviours.analysis.rules import Rules, explain_command

__all__ = [
    "Change",
    "Explanation",
    "Recognition",
    "Rules",
    "distance",
    "distances",
    "explain",
    "explain_command",
    "recognise",
    "switching_weight",
    "switching_weights",
]
