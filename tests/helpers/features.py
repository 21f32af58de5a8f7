"""Features that may be combined, those that are refused, and configurations that cover all pairs.

A configuration takes one level of every factor; the covering array holds every pair of levels but
those of ``REFUSED``.
"""

import itertools

import numpy as np

#: The first level of each factor is what a user gets without asking.
FACTORS = {
    "filter": ("ps", "sir", "dps", "sps", "branched", "labelled", "pffl", "eskil"),
    "model": ("flat", "tree", "second order", "coupled", "time-varying"),
    "likelihood": ("factors", "joint", "joint weighting"),
    "labels": ("no labels", "labels", "moving labels"),
    "motion": ("dynamics", "proposal"),
    "selection": ("always", "adaptive", "tempering"),
    "gradient": ("no gradient", "stop gradient", "score"),
    "frames": ("all frames", "missing frame", "missing partition"),
    "wrapper": ("bare", "error bars", "side by side"),
    "run": ("run", "transforms", "chunks", "stream", "resume"),
    "use": ("filtering", "smoothing", "lag", "particle Gibbs", "forecast", "pmmh"),
}
FACTOR = {level: name for name, levels in FACTORS.items() for level in levels}
#: A level, and those that are refused with it.
REFUSED = {
    "dps": {"tree", "particle Gibbs"},
    "sps": {"coupled", "joint", "joint weighting", "moving labels", "tempering", "particle Gibbs"},
    "branched": {"particle Gibbs"},
    "tree": {"joint weighting", "labelled", "pffl", "eskil"},
    "coupled": {
        *("joint weighting", "proposal", "score"),
        *("smoothing", "lag", "particle Gibbs", "labelled", "pffl", "eskil"),
    },
    "joint": {"labelled", "pffl", "eskil"},
    "joint weighting": {
        *("score", "particle Gibbs", "labelled", "pffl", "eskil"),
    },
    "labels": {"particle Gibbs", "labelled", "pffl", "eskil"},
    "moving labels": {"particle Gibbs", "labelled", "pffl", "eskil"},
    "proposal": {"labelled", "pffl", "eskil"},
    "adaptive": {"particle Gibbs", "labelled", "pffl", "eskil"},
    "tempering": {"particle Gibbs", "labelled", "pffl", "eskil"},
    "stop gradient": {"pffl", "eskil"},
    "score": {"pffl", "eskil"},
    "missing partition": {"labelled"},
    "error bars": {
        *("smoothing", "lag", "particle Gibbs", "pmmh", "labelled", "pffl", "eskil"),
    },
    "side by side": {"smoothing", "lag", "particle Gibbs", "pmmh"},
    "smoothing": {"labelled", "pffl", "eskil"},
    "lag": {"labelled", "pffl", "eskil"},
    "particle Gibbs": {"labelled", "pffl", "eskil"},
}
PAIRS_REFUSED = {frozenset((one, other)) for one, others in REFUSED.items() for other in others}


def allowed(levels):
    return not any(frozenset(pair) in PAIRS_REFUSED for pair in itertools.combinations(levels, 2))


def covering_array():
    """Configurations, greedily: each takes the levels that cover most pairs that are left."""
    rng = np.random.default_rng(0)
    every = itertools.combinations(FACTORS, 2)
    left = {
        frozenset(pair)
        for one, other in every
        for pair in itertools.product(FACTORS[one], FACTORS[other])
        if allowed(pair)
    }
    while left:
        best: tuple[int, tuple[str, ...]] = 0, ()
        ordered = sorted(map(sorted, left))
        for _ in range(30):
            chosen = list(ordered[rng.integers(len(left))])
            others = [name for name in FACTORS if name not in map(FACTOR.get, chosen)]
            for name in rng.permutation(others):
                levels = [x for x in FACTORS[name] if allowed([*chosen, x])]
                gains = [sum(frozenset((x, y)) in left for y in chosen) for x in levels]
                chosen.append(levels[int(np.argmax(gains))])
            pairs = {frozenset(pair) for pair in itertools.combinations(chosen, 2)} & left
            best = max(best, (len(pairs), tuple(sorted(chosen, key=list(FACTOR).index))))
        left -= {frozenset(pair) for pair in itertools.combinations(best[1], 2)}
        yield best[1]


def default_with(*levels):
    others = [x[0] for name, x in FACTORS.items() if name not in map(FACTOR.get, levels)]
    return tuple(sorted([*levels, *others], key=list(FACTOR).index))


def shown(config):
    return ", ".join(x for x in config if x != FACTORS[FACTOR[x]][0]) or "defaults"
