"""The runs of an evaluation: scheduled, carried out, kept and resumed."""
