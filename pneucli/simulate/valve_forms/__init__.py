"""The forms of a valve's effective area: a map over the command, a line, two areas."""
