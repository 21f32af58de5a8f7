"""The figures that judge the paper's claims, by the claims' keys."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.measures import points as measures
from jaxpf.papers.eskil2014 import methods, published
from jaxpf.papers.eskil2014.scenes import Outcome
from jaxpf.papers.eskil2014.tables import NEAR, by_scene, found_again, kept
from jaxpf.papers.judging.claims import Quantity
from jaxpf.papers.judging.estimates import gap_of, mean_of, rate_of, ratio_of

Quantities = dict[str, list[Quantity]]
#: Frames after the middle of a blink in which the eye is open again.
_OPEN = range(5, 11)


def quantities(outcomes: Mapping[str, Outcome]) -> Quantities:
    """Key of a claim -> its figures; sequences that were not run are omitted."""
    figures: dict[str, Quantity] = {}
    for scene, measure in {"fish": _fish, "skydivers": _skydivers, "face": _face}.items():
        if scene in outcomes:
            figures |= measure(outcomes[scene])
    return {key: [figure] for key, figure in figures.items()}


def _errors(outcome: Outcome, method: str, frames: slice = slice(None)) -> np.ndarray:
    """Mean errors ``[S]`` over a range of frames, in % of the length."""
    return 100 * by_scene(outcome, method, lambda e, v: measures.mean_error(e[:, frames]))


def _gap(outcome: Outcome, other: str, frames: slice = slice(None)) -> Quantity:
    """Error of another method minus the error of the proposed method."""
    error = _errors(outcome, other, frames)
    return mean_of(error - _errors(outcome, methods.PROPOSED, frames)[: len(error)])


def _fish(outcome: Outcome) -> dict[str, Quantity]:
    share = {name: by_scene(outcome, name, kept) / len(outcome.names) for name in outcome.errors}
    last = slice(-10, None)
    figures = {
        "fish_kept": rate_of(share[methods.PROPOSED]),
        "fish_tenfold": ratio_of(
            _errors(outcome, methods.PFFL, last), _errors(outcome, methods.PROPOSED, last)
        ),
        "fish_found_again": rate_of(by_scene(outcome, methods.PROPOSED, found_again)),
    }
    if methods.SPOT in share:
        spot, ours = (_errors(outcome, name, last) for name in (methods.SPOT, methods.PROPOSED))
        figures["fish_spot"] = ratio_of(spot, ours[: len(spot)])
    if methods.PRINTED in share:
        figures["fish_kept_printed"] = rate_of(share[methods.PRINTED])
    for key, pffl in (
        ("fish_pffl", methods.PFFL),
        ("fish_pffl_printed", "PFFL as printed"),
        ("fish_pffl_drift", methods.WITH_DRIFT),
    ):
        if pffl in share:
            figures[key] = gap_of(share[methods.PROPOSED][:, None], share[pffl][:, None])
    if outcome.visible.shape[1] > published.FISH_PARTED.stop:
        figures["fish_together"] = _gap(outcome, methods.PFFL, published.FISH_TOGETHER)
        figures["fish_parted"] = _gap(outcome, methods.PFFL, published.FISH_PARTED)
    for ablation in ("without drift", "without shape"):
        if ablation in outcome.errors:
            figures[f"fish_{ablation.replace(' ', '_')}"] = _gap(outcome, ablation)
    return figures


def _skydivers(outcome: Outcome) -> dict[str, Quantity]:
    chosen = [outcome.names.index(name) for name in ("head", "left hand", "right hand")]

    def together(errors, visible):
        near = errors[..., chosen] <= published.SKYDIVER_MOSTLY
        return near.all(axis=-1).mean(axis=-1)

    # The peak of each run, since the mean over runs would hide a lost run.
    peak = by_scene(outcome, methods.PROPOSED, lambda e, v: e.mean(axis=2).max(axis=1))
    figures = {
        "skydivers_peak": mean_of(peak),
        "skydivers_near": rate_of(by_scene(outcome, methods.PROPOSED, together)),
    }
    after = published.PARTING["skydivers"]
    if methods.PFFL in outcome.errors and outcome.visible.shape[1] > after:
        figures["skydivers_before"] = _gap(outcome, methods.PFFL, slice(0, after))
        figures["skydivers_after"] = _gap(outcome, methods.PFFL, slice(after, None))
    if methods.SPOT in outcome.errors and outcome.visible.shape[1] > published.SPOT_LOST:
        figures["skydivers_spot"] = _gap(outcome, methods.SPOT, slice(published.SPOT_LOST, None))
    return figures


def _face(outcome: Outcome) -> dict[str, Quantity]:
    figures, num_frames = {}, outcome.visible.shape[1]
    after = published.PARTING["face"]
    if methods.PFFL in outcome.errors and num_frames > after:
        figures["face_before"] = _gap(outcome, methods.PFFL, slice(0, after))
        figures["face_after"] = _gap(outcome, methods.PFFL, slice(after, None))
        if methods.SPOT in outcome.errors:
            figures["face_spot"] = _gap(outcome, methods.SPOT, slice(after, None))
    if num_frames > published.BLINKS[-1] + _OPEN.stop:
        eyes = [place for place, name in enumerate(outcome.names) if "eye" in name]
        frames = [blink + after for blink in published.BLINKS for after in _OPEN]

        def after_blinks(errors: Any, visible: Any) -> Any:
            return (errors[:, frames][..., eyes] <= NEAR).mean(axis=(1, 2))

        figures["face_blinks"] = rate_of(by_scene(outcome, methods.PROPOSED, after_blinks))
    begin, end = published.SMILE
    if num_frames > end:
        corner = outcome.names.index("right lip corner")
        smiling, later = (
            100
            * by_scene(outcome, methods.PROPOSED, lambda e, v, f=f: e[:, f, corner].mean(axis=1))
            for f in (slice(begin + 6, end - 6), slice(-10, None))
        )
        figures["face_smile"] = mean_of(smiling - later)
    return figures
