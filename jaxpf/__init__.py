"""jaxpf: particle filters for visual tracking of many, articulated and deformable objects.

The map, from top to bottom.  A folder imports from itself and from folders below it, never from
above; a test holds this.

``cli/``
    The command line: one folder per group of commands, ``shared/`` for what they have in common.
``papers/``
    The papers' tables and figures repeated: one folder per paper, all alike, and ``judging/``.
``evaluation/``
    Many runs of many methods compared, with intervals; ``engine`` runs them and resumes,
    ``tables`` and ``report`` say what they show, ``baselines/`` holds other trackers.
``tuning/``
    Parameters found by gradient descent, or drawn from their posterior.
``detections/``
    ``follow``, the one generator of tracked frames: of objects that start together, later, or come
    and go by detections.
``boxes/``, ``parts/``, ``points/``, ``contours/``
    One folder per kind of target: its factory, target, models, files and drawing.
``targets/``
    What a kind of target must offer, their registry, and how factories complete their options.
``sequences/``
    The only reader of recordings with annotations, one function per layout.
``media/``, ``measures/``, ``files/``
    Video in and out, drawing and plots; metrics, scores and intervals; atomic writing, locks,
    the resumable store and saved states.
``smoothing/``
    Backward simulation over a filter's particles.
``filters/``
    ``partitioned/`` (SIR, PS, DPS, SPS and branched sampling, one kernel), ``labelled/`` (each
    particle holds one of many targets), ``factored/`` (PFFL and eskil2014), ``uncertainty/``.
``running/``
    ``run``, ``monte_carlo``, ``stream`` and ``forecast``, over the frames; missing frames.
``proposals``
    Guided (data-dependent) proposals.
``likelihoods/``, ``dynamics/``, ``shapes/``
    Observation models, motion models, and shapes.
``gradients``, ``resampling/``, ``ordering``
    Gradients through resampling, resampling schemes, and orderings, which are data.
``contract/``
    The protocols of what users write (trackers, dynamics, likelihoods), states, options and errors.
``lowering/``
    Compiler workarounds.

``scenes``, the package beside this one, draws synthetic sequences; it imports nothing of
``jaxpf``.

The public names stand in ``__init__.pyi`` and are imported when they are first used (PEP 562):
importing JAX takes most of a second, which ``jaxpf --help`` does not need.
"""

import lazy_loader as lazy

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
