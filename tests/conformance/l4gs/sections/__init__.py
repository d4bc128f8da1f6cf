"""One file for each section of the stream, and for what several of them share."""
