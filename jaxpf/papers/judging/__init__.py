"""Published claims and how they are judged."""
