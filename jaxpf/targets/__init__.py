"""What a substate means: one module per target."""
