"""The answer in words and values."""
