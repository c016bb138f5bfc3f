"""One file a command: each declares ``COMMAND``, and its name is that of the file."""
