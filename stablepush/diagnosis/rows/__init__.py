"""What a log shows: rows of pushes, the fingers, noise of the readings."""
