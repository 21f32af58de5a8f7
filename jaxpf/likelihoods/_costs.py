"""What the two ways to count histograms cost, so that the cheaper one can be chosen."""

#: Runs for which the cheaper way is chosen, however many there are.
USUAL_RUNS = 25

# Nanoseconds on two busy CPU cores; see estimated_costs.
_TABLE_PIXEL, _TABLE_ENTRY = 65.0, 1.6
_INTEGRAL_QUERY, _INTEGRAL_BIN = 100.0, 1.0
_SAMPLED_PIXEL, _SAMPLED_QUERY = 25.0, 55.0
_SAMPLED_GROUP, _SAMPLED_LEVEL = 5.7, 0.1
_BILINEAR_PLACE, _BILINEAR_BIN = 56.0, 43.0


def estimated_costs(
    *,
    num_pixels: int,
    num_bins: int,
    num_levels: int | None = None,
    num_parts: int = 2,
    num_objects: int = 1,
    num_particles: int = 300,
    num_runs: int = 1,
    samples: int = 16,
    interpolation: str = "nearest",
) -> dict[str, float]:
    """Estimated time of one frame by either method, nanoseconds.

    The integral method fills a table of pixels x bins, once for all runs, and then pays
    for every bin of every part of every particle.  The sampled method pays for every group of
    four samples of every particle, and for comparing it with ``num_levels`` levels, those bins
    that one object's part uses (by default as many as all together).  The constants were
    measured side by side on two busy CPU cores in float32, 32 and 80 bins, 8 and 40 levels, 8 to
    24 samples; only their ratios matter.  On 360 x 288 pixels, with 64 bins, 16 levels and 16
    samples, the methods break even at about 50 000 particles, counted over runs and objects.
    """
    num_levels = num_bins if num_levels is None else num_levels
    queries = num_objects * num_particles * num_runs
    if interpolation == "bilinear":
        return {
            "integral": num_pixels * (_TABLE_PIXEL + num_bins * _TABLE_ENTRY)
            + queries * num_parts * num_bins * _BILINEAR_BIN,
            "sampled": num_pixels * _SAMPLED_PIXEL + queries * samples**2 * _BILINEAR_PLACE,
        }
    groups = -(-samples // (2 * num_parts)) * num_parts * -(-samples // 2)
    return {
        "integral": num_pixels * (_TABLE_PIXEL + num_bins * _TABLE_ENTRY)
        + queries * (_INTEGRAL_QUERY + num_parts * num_bins * _INTEGRAL_BIN),
        "sampled": num_pixels * _SAMPLED_PIXEL
        + queries * (_SAMPLED_QUERY + groups * (_SAMPLED_GROUP + num_levels * _SAMPLED_LEVEL)),
    }


def costs_of_frame_and_particle(
    method: str, num_pixels: int, shape: tuple[int, int], samples: int, interpolation: str
) -> tuple[float, float]:
    """Nanoseconds of one frame for all particles, and of one particle's part.

    Args:
        method: "integral" or "sampled".
        num_pixels: of a frame.
        shape: parts and bins of a reference.
        samples: per side of a box.
        interpolation: "nearest" or "bilinear".
    """

    def cost(num_runs: int) -> float:
        return estimated_costs(
            num_pixels=num_pixels,
            num_bins=shape[1],
            num_parts=shape[0],
            num_particles=1,
            num_runs=num_runs,
            samples=samples,
            interpolation=interpolation,
        )[method]

    return cost(0), cost(1) - cost(0)
