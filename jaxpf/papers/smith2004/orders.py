"""Does the order of the objects matter?  Best against worst, and a permutation test."""

import numpy as np

_CHUNK = 100  # permutations at a time, to limit memory


def shuffled_orders(recovered: np.ndarray, count: int = 2000, seed: int = 0) -> np.ndarray:
    """Rates per order if orders did not matter, ``[count, K]``, by permutation.

    Args:
        recovered: ``[S, K, R]`` bool, by scene, order and run.  Within a run on a scene the
            orders' outcomes are exchangeable if the order does not matter.
        count: number of permutations.
        seed: seed of the permutations.
    """
    blocks = np.moveaxis(np.asarray(recovered, float), 1, -1).reshape(-1, recovered.shape[1])
    rng = np.random.default_rng(seed)
    rates = []
    for _ in range(0, count, _CHUNK):
        shuffle = rng.random((_CHUNK, *blocks.shape)).argsort(axis=-1)
        rates.append(np.take_along_axis(blocks[None], shuffle, axis=-1).mean(axis=1))
    return np.concatenate(rates)[:count]


def best_and_worst(rates: np.ndarray) -> list[np.ndarray]:
    """Rates of the best and the worst order on half of the scenes, chosen on the other half.

    This avoids selection bias.

    Args:
        rates: ``[S, K, ...]``, by scene and order.

    Returns:
        ``[S // 2, ...]`` each.
    """
    chosen_on, compared_on = rates[::2].mean(axis=0), rates[1::2]
    chosen = (pick(chosen_on, axis=0)[None, None] for pick in (np.argmax, np.argmin))
    return [np.take_along_axis(compared_on, which, axis=1)[:, 0] for which in chosen]
