"""Factored filters: every partition has a weighted set of its own (PFFL, eskil2014)."""
