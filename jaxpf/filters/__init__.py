"""How guesses are organised: resampling, and one folder or file per filter."""
