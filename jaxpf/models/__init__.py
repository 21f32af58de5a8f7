"""How substates move and how they explain a frame."""
