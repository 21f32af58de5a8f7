"""Claims of the papers, and how they are judged."""
