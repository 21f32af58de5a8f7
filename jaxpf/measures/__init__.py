"""How good tracks are: metrics, benchmark scores, intervals, matching."""
