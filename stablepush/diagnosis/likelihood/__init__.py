"""What the simulation predicts of the rows, and how probable they are."""
