"""Monte Carlo error, from parallel runs or from the ancestors of a single run."""
