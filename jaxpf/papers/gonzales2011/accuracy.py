"""How exact a likelihood from samples of a part is."""

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf.likelihoods.color import hsv_bins
from jaxpf.papers.gonzales2011.published import SHARPNESS
from jaxpf.papers.gonzales2011.scenes import NOISE, learn


def likelihood_errors(samples: int, num_parts: int = 7, poses_per_part: int = 40) -> np.ndarray:
    """Log-likelihood errors ``[P, M]`` of M poses of every part, on the smooth scene."""
    scene = scenes.make("articulated", 0, num_parts=num_parts, num_frames=1)
    likelihood, frame = learn(scene, samples), jnp.asarray(scene.frames[0])
    position, angle = NOISE["smooth"].absolute
    strewn = np.random.default_rng(0).normal(size=(num_parts, poses_per_part, 3))
    poses = scene.extras["poses"][0][:, None] + strewn * [position, position, angle]
    x, y, theta = poses.reshape(-1, 3).T
    partition = np.repeat(np.arange(num_parts), poses_per_part)
    substates = jnp.asarray(np.stack([x, y, np.ones_like(x), theta]), jnp.float32)
    sampled = jax.jit(likelihood.log_prob_all)(likelihood.observe(frame), partition, substates)
    bins = np.asarray(likelihood.bin_lookup)[np.asarray(hsv_bins(frame))]
    references = np.asarray(likelihood.references)[:, 0]
    exact = [
        _every_pixel(bins, references[part], pose, scene.sizes[part])
        for part, pose in zip(partition, poses.reshape(-1, 3), strict=True)
    ]
    return (np.asarray(sampled, float) - np.array(exact)).reshape(num_parts, -1)


def _every_pixel(
    bins: np.ndarray, reference: np.ndarray, pose: np.ndarray, size: np.ndarray
) -> float:
    """Log-likelihood of a pose, from all pixels whose middle lies in the rectangle."""
    rows, columns = np.indices(bins.shape) + 0.5
    across, down = columns - pose[0], rows - pose[1]
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    inside = (np.abs(cosine * across + sine * down) < size[0] / 2) & (
        np.abs(cosine * down - sine * across) < size[1] / 2
    )
    counts = np.bincount(bins[inside], minlength=len(reference) + 1)[: len(reference)]
    similarity = np.sum(np.sqrt(counts / inside.sum()) * reference)
    return -SHARPNESS * (1 - similarity)
