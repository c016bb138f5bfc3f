"""What changed between two sets of recordings of one rig: which parameter or effect, by how much, how sure."""
