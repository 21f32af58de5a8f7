"""Refusals that depend on arrays: an error where they are known, NaN where they are traced."""

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.calls import likelihood_of, optional, unwrapped
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.pytree import T, is_concrete
from jaxpf.contract.state import STATUS_OK, STATUS_UNSUPPORTED, Summary
from jaxpf.contract.types import TrackerLike


def refused(*cases: tuple[Any, Iterable[str | Argument]]) -> Any:
    """Refuse the first case that is known to hold; return whether a traced one holds, or None.

    A case is a condition, bool of any shape or None, with the pieces of its ``InputError``; what is
    returned is for ``poisoned``.
    """
    traced = None
    for condition, pieces in cases:
        if condition is None:
            continue
        if is_concrete(condition):
            if np.any(condition):
                raise InputError(*pieces)
        else:
            traced = condition if traced is None else traced | condition
    return traced


class Bias(NamedTuple):
    """A setting for which a tracker's ``exp(log_evidence)`` is biased, see ``evidence_biases``.

    Attributes:
        applies: ``[]`` bool.
        cause: the setting, in a message.
        remedy: the unbiased setting.
        gross: whether the evidence is of no use at any number of particles, for tuning either.
    """

    applies: jax.Array | bool
    cause: str
    remedy: str
    gross: bool = True


def evidence_biases(tracker: TrackerLike) -> Sequence[Bias]:
    """Settings that bias a tracker's evidence, of a wrapper those inside.

    They are its property ``evidence_biases``, without which its evidence is unbiased, and a
    likelihood that looks near the particles' mean: a particle's weight then depends on the others.
    """
    biases = optional(unwrapped(tracker, "evidence_biases"), "evidence_biases")
    likelihood = likelihood_of(tracker)
    if not optional(likelihood, "look_near"):
        return biases
    cause = f"{type(likelihood).__name__}, which looks near the particles' mean,"
    return *biases, Bias(True, cause, "a likelihood of the frame alone", gross=False)


def biased_evidence(
    tracker: TrackerLike, what: str, otherwise: str, tuning: bool = False
) -> jax.Array | None:
    """Refuse a tracker with a biased evidence for ``what``; see ``refused`` for what is returned.

    The message gives the unbiased setting, or ``otherwise``.  For ``tuning``, gross biases alone
    matter.
    """
    return refused(
        *(
            (
                bias.applies,
                [
                    f"{what} needs an unbiased estimate of the marginal likelihood, and "
                    f"{bias.cause} biases it; use {bias.remedy}, or {otherwise}."
                ],
            )
            for bias in evidence_biases(tracker)
            if bias.gross or not tuning
        )
    )


def poisoned(refused: jax.Array | None, tree: T) -> T:
    """Replace a tree's floats by NaN, and mark its summaries, where ``refused``, ``[]`` or None."""
    if refused is None:
        return tree

    def with_nan(leaf: jax.Array) -> Any:
        is_float = jnp.issubdtype(leaf.dtype, jnp.floating)
        return jnp.where(refused, jnp.nan, leaf).astype(leaf.dtype) if is_float else leaf

    def marked(node: object) -> Any:
        if not isinstance(node, Summary):
            return node
        bit = jnp.where(refused, STATUS_UNSUPPORTED, STATUS_OK).astype(node.status.dtype)
        return dataclasses.replace(node, status=node.status | bit)

    tree = jax.tree.map(with_nan, tree)
    return jax.tree.map(marked, tree, is_leaf=lambda node: isinstance(node, Summary))
