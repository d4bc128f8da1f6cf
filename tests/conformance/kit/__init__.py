"""What `check` is made of. It knows the frame of a stream, and nothing of what sections hold."""
