"""How much another run would differ: runs side by side, or the ancestors of a single run."""
