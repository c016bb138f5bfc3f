"""Mutation testing: small faults are put into the code one at a time; a unit test has to notice each of them."""
