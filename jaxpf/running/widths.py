"""Widths of the blocks in which runs are vectorised."""

from jaxpf.lowering import platform

#: Block widths for many and for few runs on a CPU, whose cache they suit.  A block of 5 costs up to
#: a third more per run than one of 25, but computing 25 runs to get one costs ten times as much.
WIDE, NARROW = 25, 5
#: From this number of remaining runs, one padded wide block is cheaper than narrow blocks.
_MANY_LEFT = 20
#: ``((count, width), ...)``: ``count`` blocks of ``width`` vectorised runs, in sequence.
Blocks = tuple[tuple[int, int], ...]


def blocks_of(num_runs: int, asked: int | None = None, most: int | None = None) -> Blocks:
    """Divide runs into blocks of at most two widths.

    On a CPU this depends only on their number.  With 25 runs or more: blocks of 25, and the rest in
    blocks of 5, the last one padded.  With fewer: blocks of 5 and one block of the rest.

    On an accelerator: one block, whose width ``run_blocks`` adapts to the memory.

    Args:
        num_runs: number of runs to do.
        asked: total number of runs requested, of which ``num_runs`` remain; default ``num_runs``.
        most: largest width on an accelerator; default ``num_runs``.
    """
    if platform.on_accelerator():
        return even_blocks(num_runs, most or num_runs)
    if (num_runs if asked is None else asked) < WIDE:
        blocks = (num_runs // NARROW, NARROW), (1, num_runs % NARROW)
    else:
        wide, left = divmod(num_runs, WIDE)
        if left >= _MANY_LEFT:
            wide, left = wide + 1, 0
        blocks = (wide, WIDE), (-(-left // NARROW), NARROW)
    return tuple((count, width) for count, width in blocks if count * width)


def even_blocks(num_runs: int, most: int) -> Blocks:
    """Divide runs into as few blocks of one width, at most ``most``, as possible."""
    count = -(-num_runs // max(1, most))
    return ((count, -(-num_runs // count)),)


def widest(blocks: Blocks) -> int:
    """Largest width."""
    return max(width for _, width in blocks)
