"""One file for each section of the stream, and for code that several of them share."""
