"""Closed forms of how much one hypervector holds.

`k` pairs are bound, bundled in one step and queried with the key of each, or `k` items are bundled without keys. The
answer is compared with `N` items. The results are expectations for independent random hypervectors; nothing is drawn.

They hold for sums in which each pair is counted once, as in `VSA.bundle` and `behaviours.OneShot`. Programs that are
trained hold far more.

Sources: Plate 1994, "Distributed representations and nested compositional structure"; Frady, Kleyko and Sommer 2018,
"A theory of sequence indexing and working memory in recurrent neural networks", arXiv 1803.00412.
"""

from torchvsa.capacity._forms import CLOSED_FORMS, Atoms, Score, Stored
from torchvsa.capacity._recall import Kind, dim_needed, pairs_held, recall_probability
from torchvsa.capacity._winners import top_probability, winner_probability

__all__ = [
    "CLOSED_FORMS",
    "Atoms",
    "Kind",
    "Score",
    "Stored",
    "dim_needed",
    "pairs_held",
    "recall_probability",
    "top_probability",
    "winner_probability",
]
