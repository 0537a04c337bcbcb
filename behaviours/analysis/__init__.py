"""Ask behaviours about themselves: how far apart, which one, from where on, and why."""

from behaviours.analysis.distance import distance, distances
from behaviours.analysis.explaining import Change, Explanation, explain
from behaviours.analysis.interpolation import switching_weight, switching_weights
from behaviours.analysis.recognition import Recognition, recognise

__all__ = [
    "Change",
    "Explanation",
    "Recognition",
    "distance",
    "distances",
    "explain",
    "recognise",
    "switching_weight",
    "switching_weights",
]
