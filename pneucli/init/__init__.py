"""What a raw file of unknown origin holds, guessed for people to correct."""
