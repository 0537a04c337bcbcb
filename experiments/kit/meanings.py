"""What the settings of the library's parts mean, for `--help` and the docs: a line for each name."""

MEANINGS = {
    # architectures
    "dim": "elements of a hypervector",
    "dtype": "type of an element: int8 codes are exact, smallest and fastest; float32 can be trained by gradient",
    "atoms": "elements of a random hypervector: bipolar (-1 and 1) or uniform in [-1, 1]",
    # encoders
    "bins": "bins of equal width over a sensor's range",
    "span": "bins apart at which two level codes are unrelated; null for all of the range",
    "length": "distance, as a share of the range, over which codes stay similar",
    "kernel": "how similarity falls with the distance: gaussian or sinc",
    "sign": "keep only the signs of the features",
    "subset": "sensors that take part in each element at most; null for all",
    # protections
    "width": "how far a condition is shifted: by the mean index of its positive elements, or by their sum",
    "shift": "places by which every condition is shifted",
    # learning rules
    "novelty": "when a condition is new: exact equality, or similarity to the sum of those known",
    "sigmas": "similarity that counts as known, in standard deviations of chance",
    "threshold": "similarity that counts as known; null for `sigmas`",
    "clip_each_step": "clip the program after each pair, as the printed algorithm does",
    "contradictions": "which result a condition shown with several is trained on",
    "margin": "lead over the next result that counts as correct, in scores of one stored pair",
    "epochs": "passes over the samples at most",
    "average": "the mean of the program over all visits, instead of the last one",
    "evidence": "how much louder a pair is the more often it was shown: this times log(1 + count)",
    "smooth": "commands between the levels, where a study asks behaviours one by one",
    "patience": "epochs without progress after which training ends",
    "ridge": "penalty on the program's length",
    "loss": "what gradient descent makes small",
    "batch_size": "samples per step of gradient descent",
    "learning_rate": "size of its steps",
    "sparse": "train the roots of two squares whose difference is the program, which favours few large elements",
    "validation_fraction": "share of the samples held back to choose the epoch",
    "output": "type of the finished program's elements",
    "seed": "seed of the order of samples, or of the contexts",
    # policies
    "weights": "weight of each behaviour by name; null for 1 each",
    "order": "names of the behaviours, the first that knows the condition speaks; null for the bank's order",
    "thresholds": "familiarity from which a behaviour knows a condition, by name; null: by its own conditions",
    "beta": "how strongly the behaviour that knows the condition best prevails; 0 is the plain mean",
    "familiarity": "weigh each behaviour by how well it knows the condition",
}
