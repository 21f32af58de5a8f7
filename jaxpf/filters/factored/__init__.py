"""Factored filters: each partition has its own weighted set (PFFL, eskil2014)."""
