from .layouts import open_sequence as open_sequence
