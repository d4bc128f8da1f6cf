"""The parts of `check`. They know the frame of a stream, and nothing of the contents of sections."""
